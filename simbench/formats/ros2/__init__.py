"""ROS 2 bags (MCAP): recordings written for others' tools, and drives of others' stacks read in."""

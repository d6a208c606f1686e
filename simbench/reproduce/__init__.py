"""The paper beside our runs: its tables by its own protocol and by ours."""

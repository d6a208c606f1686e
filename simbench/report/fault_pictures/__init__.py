"""A small picture of every fault: what a sensor or the fusion has without it and with it."""

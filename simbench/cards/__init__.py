"""Cards: what a data set holds, in numbers and plots, and how it compares with recorded data."""

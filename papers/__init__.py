"""The two works beside jampetsc: the runs of each figure, what they gave, its pictures, and claims judged by it."""

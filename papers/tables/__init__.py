"""Tables of what a figure has left in its folder, and a picture of them: one program for each figure that needs one."""

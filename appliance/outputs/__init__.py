"""What leaves the box: the joint frame and its receivers."""

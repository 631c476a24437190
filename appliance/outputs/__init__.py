"""What leaves the box: the joint frame and the receivers that get it."""

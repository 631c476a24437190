"""Poses: quaternions, skeletons, recordings, BVH files and pictures of them."""

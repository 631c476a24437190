"""Recordings of other programs in and out: BVH, glTF, tables, points that cameras tracked."""

"""Recordings of other programs in: glTF, tables, points that cameras tracked; and onto other skeletons."""

"""Recordings out, for other programs: BVH, glTF, tables. The studio reads them (`studio/exchange`)."""

"""DMX receivers, independent of the box's code: Art-Net and sACN nodes and USB adapters, written from their
standards.
"""

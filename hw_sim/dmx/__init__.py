"""DMX receivers written from the standards: Art-Net and sACN nodes, USB adapters; none of the box's code."""

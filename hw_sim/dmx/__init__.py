"""What receives DMX, by itself: Art-Net and sACN nodes and USB adapters, written from their standards."""

"""Where a twin departs from reality, which missing effect causes it, and how far the gap shrinks with it."""

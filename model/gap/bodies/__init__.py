"""Bodies to simulate for objects of which only moving points are known. One kind of object, one file."""

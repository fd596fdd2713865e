"""A procedural world: objects of many shapes and materials, handled in many ways, and what is seen of it."""

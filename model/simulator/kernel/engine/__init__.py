"""The engine of a kernel, as C++ text; the laws come between its parts."""

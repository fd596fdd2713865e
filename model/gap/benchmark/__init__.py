"""The withheld check: worlds that other code made, diagnosed, and only then compared with their labels.

Nothing is imported here: those who make worlds read `labels` alone.
"""

"""Observations made from what others recorded: a PhysTwin case, or a clip and its twin."""

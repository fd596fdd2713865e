"""Which recordings may show the same thing, told from their names: what must not be split."""

MOTIONS = frozenset(("single", "double", "hand", "lift", "clift", "push", "stretch", "fold", "drop", "shake"))
"""Words of a name that say what was done to the object."""


def object_group(object_name: str) -> str:
    """What was recorded, not what was done to it: `sloth` of `single_lift_sloth` and `double_lift_sloth`.

    Recordings of one thing that were reconstructed one by one have topologies, and so names, of their own;
    a predictor that saw one has seen them all. A number behind (`single_lift_cloth_1`) is taken for that of
    the clip: nothing tells whether another number means another cloth, and two things that are kept
    together harm less than one that is split. A name without a word of motion is left as it is
    (`cup_1`, `plush-0-0007`).
    """
    words = object_name.split("_")
    left = [word for word in words if word not in MOTIONS]
    if len(left) == len(words):
        return object_name
    while left and left[-1].isdigit():
        left.pop()
    return "_".join(left) or object_name

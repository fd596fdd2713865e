"""Contact terms. One kind of contact, one file; listed here, a term is in the shared property tests."""

from model.simulator.contacts.ground import Ground
from model.simulator.contacts.self_collision import SelfCollision

ALL_CONTACTS = (Ground, SelfCollision)

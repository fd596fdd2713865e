"""Contact terms. One kind of contact, one file; listed here, a term is in the shared property tests."""

from model.simulator.contacts.ground import Ground

ALL_CONTACTS = (Ground,)

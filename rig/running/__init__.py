"""A procedure on a bench into the record: who looks on, how far it is, what comes after."""

"""The playground: a twin that moves while its user pulls at it and changes what acts on it."""

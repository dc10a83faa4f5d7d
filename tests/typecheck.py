"""The checker that enforces annotations in tests. As PEP 484 has it, an int will do where a float is asked for."""

from beartype import BeartypeConf, beartype

enforced = beartype(conf=BeartypeConf(is_pep484_tower=True))

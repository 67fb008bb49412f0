"""How a flight hands data to other processes without ever waiting for them."""

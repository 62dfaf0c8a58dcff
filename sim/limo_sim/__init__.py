"""A 10 x 10 m arena with a walking person and a Limo robot."""

"""How many steps and transforms runs take, and the numbers of the forecast of them."""

"""Studies: grids of runs, statistics over them, and what is shown of them."""

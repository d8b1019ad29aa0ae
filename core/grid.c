// grid: see grid.h

// material: see material.h

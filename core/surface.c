// surface: see surface.h

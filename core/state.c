// state: see state.h

// step: see step.h

// contact: see contact.h

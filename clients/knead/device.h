#include "clients/knead/virtual_hand.h"

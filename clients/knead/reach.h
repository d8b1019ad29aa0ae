#include "clients/knead/pointer_hand.h"

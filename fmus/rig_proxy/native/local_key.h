/* The key that a rig's server on this machine leaves for its user's clients (fmus/rig_proxy/local_key.py). */
#ifndef LOCAL_KEY_H
#define LOCAL_KEY_H

#include "sockets.h"

enum { KEY_SIZE = 101 };

/* The key of the server at an address; empty if there is none, or others than this user could have written or read it. */
static void local_key(const Address *address, char key[KEY_SIZE]);

#endif

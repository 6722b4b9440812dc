/* The key of a rig's server: a line in a file of its user's alone. */
#include "platform.h"

#include "local_key.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { PATH_SIZE = 1024, HOST_SIZE = 256 };

#ifdef _WIN32
#include <winsock2.h>

static bool state_folder(char folder[PATH_SIZE]) {
    const char *base = getenv("LOCALAPPDATA");
    return base != NULL && snprintf(folder, PATH_SIZE, "%s", base) < PATH_SIZE;
}

/* There the folder is its user's by what it inherits. */
static FILE *open_own(const char *path) { return fopen(path, "r"); }
#else
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

static bool state_folder(char folder[PATH_SIZE]) {
    const char *base = getenv("XDG_STATE_HOME"), *home = getenv("HOME");
    if (base != NULL && base[0] != '\0')
        return snprintf(folder, PATH_SIZE, "%s", base) < PATH_SIZE;
    return home != NULL && snprintf(folder, PATH_SIZE, "%s/.local/state", home) < PATH_SIZE;
}

/* A file that is no link, of this user, and that nobody else can read or write. */
static FILE *open_own(const char *path) {
    struct stat about;
    int descriptor = open(path, O_RDONLY | O_NOFOLLOW);
    if (descriptor < 0)
        return NULL;
    if (fstat(descriptor, &about) == 0 && about.st_uid == geteuid() && (about.st_mode & 077) == 0)
        return fdopen(descriptor, "r");
    close(descriptor);
    return NULL;
}
#endif

/* Every character of the address that is no digit and no dot is an underscore. */
static void address_name(const Address *address, char name[HOST_SIZE]) {
    const unsigned char *host = address->host;
    if (address->version_6)
        snprintf(name, HOST_SIZE, "___1__%u", address->port);
    else
        snprintf(name, HOST_SIZE, "%u.%u.%u.%u_%u", host[0], host[1], host[2], host[3], address->port);
}

void local_key(const Address *address, char key[KEY_SIZE]) {
    char folder[PATH_SIZE], path[2 * PATH_SIZE], machine[HOST_SIZE] = "", name[HOST_SIZE];
    FILE *file;
    key[0] = '\0';
    if (!state_folder(folder) || gethostname(machine, sizeof machine - 1) != 0)
        return;
    address_name(address, name);
    snprintf(path, sizeof path, "%s/ppy-rig/keys/%s-%s.key", folder, machine, name);
    file = open_own(path);
    if (file == NULL)
        return;
    if (fgets(key, KEY_SIZE, file) == NULL)
        key[0] = '\0';
    key[strcspn(key, "\r\n")] = '\0';
    fclose(file);
}

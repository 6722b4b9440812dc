/* The path in a resource location. */
#ifndef RESOURCES_H
#define RESOURCES_H

/* The path in a resource location, which is a file URI or already a path; to be freed. NULL if there is none. */
static char *resource_path(const char *location);

#endif

/* What a compiler of Modelica gives to external functions, as far as ours call it: an error does not return. */
#ifndef MODELICA_UTILITIES_H
#define MODELICA_UTILITIES_H
void ModelicaFormatError(const char *format, ...);
#endif

/* Functions of FMI 2.0 that hosts look for when they load a library, and that nobody calls. */
#define ABSENT(Name) \
    fmi2Status fmi2##Name(void) { return fmi2Error; }

ABSENT(CancelStep)
ABSENT(GetFMUstate)
ABSENT(SetFMUstate)
ABSENT(FreeFMUstate)
ABSENT(SerializedFMUstateSize)
ABSENT(SerializeFMUstate)
ABSENT(DeSerializeFMUstate)
ABSENT(GetDirectionalDerivative)
ABSENT(SetRealInputDerivatives)
ABSENT(GetRealOutputDerivatives)
ABSENT(GetStatus)
ABSENT(GetRealStatus)
ABSENT(GetIntegerStatus)
ABSENT(GetBooleanStatus)
ABSENT(GetStringStatus)

/* The Python engine: the component's own Python class computes, on the memory of the instance.
 *
 * The package in resources/python offers create(memory, texts), `memory` being a writable memoryview of doubles laid
 * out as in engine.h, `texts` one of bytes, TEXT_SIZE for each text. The object it returns has initialize(),
 * evaluate(time) for the outputs, differentiate(time) for the derivatives of the states and advance(time, step), each
 * of which returns None or the text of an error, warning() for what is to be said of a step that succeeded, terminate()
 * and close(). Whatever they raise becomes an error of the FMU.
 */
#include "python.h"
#include "resources.h"

#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct Engine {
    Python python;
    PyObject *none;
    PyObject *names; /* the dictionary the bootstrap runs in; it keeps everything below alive */
    PyObject *initialize, *evaluate, *differentiate, *advance, *warning, *terminate;
};

static const bool engine_interpolates = false;
static const bool engine_exchanges = false;
static const bool engine_differentiates = false;

/* Every FMU is imported under a name of its own, so that FMUs never share modules. Only those names and one module
   with the bookkeeping are added to sys.modules, sys.path is left alone, and no bytecode is written into the FMU. */
static const char bootstrap[] =
    "import importlib.util, os, sys, threading, types\n"
    "\n"
    "shared = sys.modules.setdefault('_ppy_fmu', types.ModuleType('_ppy_fmu')).__dict__\n"
    "users = shared.setdefault('users', {})\n"
    "with shared.setdefault('lock', threading.RLock()):\n"
    "    write_no_bytecode = sys.dont_write_bytecode\n"
    "    sys.dont_write_bytecode = True\n"
    "    try:\n"
    "        package = sys.modules.get(name)\n"
    "        if package is None:\n"
    "            folder = os.path.join(resources, 'python')\n"
    "            spec = importlib.util.spec_from_file_location(\n"
    "                name, os.path.join(folder, '__init__.py'), submodule_search_locations=[folder])\n"
    "            package = sys.modules[name] = importlib.util.module_from_spec(spec)\n"
    "            try:\n"
    "                spec.loader.exec_module(package)\n"
    "            except BaseException:\n"
    "                for key in [key for key in sys.modules if key == name or key.startswith(name + '.')]:\n"
    "                    del sys.modules[key]\n"
    "                raise\n"
    "        users[name] = users.pop(name, 0) + 1\n"
    "        memory = block.cast('d')\n"
    "        texts = strings.cast('B')\n"
    "        component = package.create(memory, texts)\n"
    "    finally:\n"
    "        sys.dont_write_bytecode = write_no_bytecode\n"
    "initialize, evaluate = component.initialize, component.evaluate\n"
    "differentiate, advance = component.differentiate, component.advance\n"
    "warning, terminate = component.warning, component.terminate\n";

/* Hosts unzip an FMU into a new folder for every run: of the packages without instances only the last few are kept. */
static const char farewell[] =
    "try:\n"
    "    if 'component' in globals():\n"
    "        component.close()\n"
    "finally:\n"
    "    if 'memory' in globals():\n"
    "        memory.release()\n"
    "        texts.release()\n"
    "        with shared['lock']:\n"
    "            users[name] -= 1\n"
    "            for idle in [other for other in users if users[other] == 0][:-4]:\n"
    "                del users[idle]\n"
    "                folder = sys.modules[idle].__path__[0]\n"
    "                for key in [key for key in sys.modules if key == idle or key.startswith(idle + '.')]:\n"
    "                    del sys.modules[key]\n"
    "                for key in [key for key in sys.path_importer_cache if key.startswith(folder)]:\n"
    "                    del sys.path_importer_cache[key]\n";

enum { FILE_INPUT = 257, WRITABLE = 0x200, READABLE_ONLY = 0x100 }; /* Py_file_input, PyBUF_WRITE, PyBUF_READ */

/* Copies the text of a Python string; false if it is none. */
static bool text_of(const Python *python, PyObject *string, char *text, size_t size) {
    PyObject *bytes = string == NULL ? NULL : python->PyUnicode_AsUTF8String(string);
    const char *characters = bytes == NULL ? NULL : python->PyBytes_AsString(bytes);
    if (characters != NULL)
        snprintf(text, size, "%s", characters);
    else
        python->PyErr_Clear();
    if (bytes != NULL)
        python->Py_DecRef(bytes);
    return characters != NULL;
}

/* Turns the current exception into a message and forgets it. */
static void describe_exception(const Python *python, Message message) {
    PyObject *parts[3] = {NULL, NULL, NULL}, *name, *string;
    char kind[128] = "an error", text[MESSAGE_SIZE - 160] = "";
    python->PyErr_Fetch(&parts[0], &parts[1], &parts[2]);
    name = parts[0] == NULL ? NULL : python->PyObject_GetAttrString(parts[0], "__name__");
    string = parts[1] == NULL ? NULL : python->PyObject_Str(parts[1]);
    text_of(python, name, kind, sizeof kind);
    text_of(python, string, text, sizeof text);
    snprintf(message, MESSAGE_SIZE, "%s%s%s", kind, *text == '\0' ? "" : ": ", text);
    if (name != NULL)
        python->Py_DecRef(name);
    if (string != NULL)
        python->Py_DecRef(string);
    for (int i = 0; i < 3; i++)
        if (parts[i] != NULL)
            python->Py_DecRef(parts[i]);
    python->PyErr_Clear();
}

/* Judges what a method returned, and releases it. */
static bool succeeded(const Engine *engine, PyObject *result, Message message) {
    const Python *python = &engine->python;
    bool good = result == engine->none;
    if (result == NULL)
        describe_exception(python, message);
    else if (!good && !text_of(python, result, message, MESSAGE_SIZE))
        snprintf(message, MESSAGE_SIZE, "the component returned neither None nor a text");
    if (result != NULL)
        python->Py_DecRef(result);
    return good;
}

static bool run(const Engine *engine, const char *source, Message message) {
    const Python *python = &engine->python;
    PyObject *code = python->Py_CompileString(source, "<fmu>", FILE_INPUT), *result = NULL;
    if (code != NULL) {
        result = python->PyEval_EvalCode(code, engine->names, engine->names);
        python->Py_DecRef(code);
    }
    return succeeded(engine, result, message);
}

/* Enters a new object under a name, for the bootstrap to use, and gives it away. */
static bool enter(const Engine *engine, const char *name, PyObject *object) {
    bool good = object != NULL && engine->python.PyDict_SetItemString(engine->names, name, object) == 0;
    if (object != NULL)
        engine->python.Py_DecRef(object);
    return good;
}

/* With Python's lock held: imports the package and creates the component. */
static bool create(Engine *engine, double *memory, const TextValue *texts, const char *path, Message message) {
    const Python *python = &engine->python;
    PyObject *builtins = python->PyEval_GetBuiltins();
    char name[40];
    snprintf(name, sizeof name, "_ppy_fmu_%016llx",
             (unsigned long long)hash(hash(HASH_START, path, strlen(path)), model_guid, strlen(model_guid)));
    engine->none = python->Py_BuildValue("");
    engine->names = python->PyDict_New();
    if (engine->names == NULL || builtins == NULL ||
        python->PyDict_SetItemString(engine->names, "__builtins__", builtins) != 0 ||
        !enter(engine, "name", python->PyUnicode_FromString(name)) ||
        !enter(engine, "resources", python->PyUnicode_DecodeFSDefault(path)) || /* back to these bytes in any locale */
        !enter(engine, "block",
               python->PyMemoryView_FromMemory((char *)memory, MEMORY_SIZE * (ptrdiff_t)sizeof(double), WRITABLE)) ||
        !enter(engine, "strings",
               python->PyMemoryView_FromMemory((char *)texts, MODEL_TEXTS * (ptrdiff_t)sizeof *texts, READABLE_ONLY))) {
        describe_exception(python, message);
        return false;
    }
    if (!run(engine, bootstrap, message))
        return false;
    engine->initialize = python->PyDict_GetItemString(engine->names, "initialize");
    engine->evaluate = python->PyDict_GetItemString(engine->names, "evaluate");
    engine->differentiate = python->PyDict_GetItemString(engine->names, "differentiate");
    engine->advance = python->PyDict_GetItemString(engine->names, "advance");
    engine->warning = python->PyDict_GetItemString(engine->names, "warning");
    engine->terminate = python->PyDict_GetItemString(engine->names, "terminate");
    return true;
}

Engine *engine_create(double *memory, const TextValue *texts, const char *resources, Message message) {
    Engine *engine = calloc(1, sizeof *engine);
    char *path = resource_path(resources);
    bool good = false;
    if (engine == NULL)
        snprintf(message, MESSAGE_SIZE, "out of memory");
    else if (path == NULL)
        snprintf(message, MESSAGE_SIZE, "fmi2Instantiate: %s needs the location of its resources", model_name);
    else if (python_find(&engine->python, message)) {
        int lock = engine->python.PyGILState_Ensure();
        Message reason = "";
        good = create(engine, memory, texts, path, reason);
        engine->python.PyGILState_Release(lock);
        if (!good)
            snprintf(message, MESSAGE_SIZE, "the Python part of %.100s cannot be used: %.850s", model_name, reason);
    }
    free(path);
    if (!good && engine != NULL) {
        engine_free(engine);
        engine = NULL;
    }
    return engine;
}

/* The host may end Python before it frees its instances; then nothing of Python is left to be released. */
void engine_free(Engine *engine) {
    const Python *python = &engine->python;
    if (engine->names != NULL && python->Py_IsInitialized()) {
        int lock = python->PyGILState_Ensure();
        Message ignored;
        run(engine, farewell, ignored);
        python->PyDict_Clear(engine->names);
        python->Py_DecRef(engine->names);
        if (engine->none != NULL)
            python->Py_DecRef(engine->none);
        python->PyGILState_Release(lock);
    }
    free(engine);
}

/* With Python's lock held. */
static bool call(const Engine *engine, PyObject *method, Message message) {
    return succeeded(engine, engine->python.PyObject_CallFunctionObjArgs(method, NULL), message);
}

bool engine_initialize(Engine *engine, Message message) {
    int lock = engine->python.PyGILState_Ensure();
    bool good = call(engine, engine->initialize, message);
    engine->python.PyGILState_Release(lock);
    return good;
}

void engine_terminate(Engine *engine) {
    if (engine->python.Py_IsInitialized()) {
        int lock = engine->python.PyGILState_Ensure();
        Message ignored;
        call(engine, engine->terminate, ignored);
        engine->python.PyGILState_Release(lock);
    }
}

static bool call_at(const Engine *engine, PyObject *method, double time, Message message) {
    const Python *python = &engine->python;
    int lock = python->PyGILState_Ensure();
    PyObject *t = python->PyFloat_FromDouble(time);
    bool good = succeeded(engine, python->PyObject_CallFunctionObjArgs(method, t, NULL), message);
    if (t != NULL)
        python->Py_DecRef(t);
    python->PyGILState_Release(lock);
    return good;
}

bool engine_evaluate(Engine *engine, double time, Message message) {
    return call_at(engine, engine->evaluate, time, message);
}

bool engine_differentiate(Engine *engine, double time, Message message) {
    return call_at(engine, engine->differentiate, time, message);
}

bool engine_advance(Engine *engine, double time, double step, Message message) {
    const Python *python = &engine->python;
    int lock = python->PyGILState_Ensure();
    PyObject *t = python->PyFloat_FromDouble(time), *h = python->PyFloat_FromDouble(step);
    bool good = succeeded(engine, python->PyObject_CallFunctionObjArgs(engine->advance, t, h, NULL), message);
    if (good && !model_restorable) /* laws alone never have anything to say */
        call(engine, engine->warning, message);
    if (t != NULL)
        python->Py_DecRef(t);
    if (h != NULL)
        python->Py_DecRef(h);
    python->PyGILState_Release(lock);
    return good;
}

/* A mechanism as a co-simulation slave: functions of FMI 2.0 (https://fmi-standard.org), declared here as far as they are used.
 *
 * Real variables by value reference: what is set, of every drive, then outputs. Where its motion is given: q, v, a; effort of every drive,
 * position of every freedom, reaction of every pair (six each). Where efforts are given: effort, and the velocity at the start;
 * position and velocity of every freedom, reactions. Integer variable 0: what the last function of the model returned. Outputs belong to
 * the inputs that were set last. */
#include "model.h"

#include <stdlib.h>
#include <string.h>

#ifdef _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT
#endif
#define GUID "@GUID@"

typedef enum { OK, WARNING, DISCARD, ERROR_, FATAL, PENDING } Status;
typedef void (*Logger)(void *environment, const char *instance, Status status, const char *category, const char *message, ...);
typedef struct {
  Logger logger;
  void *(*allocate)(size_t, size_t);
  void (*release)(void *);
  void (*finished)(void *, Status);
  void *environment;
} Callbacks;

#define UNDER_EFFORTS @EFFORTS@
#if UNDER_EFFORTS
enum { INPUTS = MODEL_DRIVES, SET = 2 * MODEL_DRIVES, OUTPUTS = 2 * MODEL_FREEDOMS + 6 * MODEL_PAIRS };
#else
enum { INPUTS = 3 * MODEL_DRIVES, SET = INPUTS, OUTPUTS = MODEL_DRIVES + MODEL_FREEDOMS + 6 * MODEL_PAIRS };
#endif

typedef struct {
  const Callbacks *callbacks;
  char *name;
  double value[SET + OUTPUTS];
  int result, stale; /* what the last solution returned; inputs were set since */
  int moved;         /* a step was made: what holds at the start cannot be set any more */
} Slave;

static const double START[SET] = {@START@};
static const char *const MEANING[] = {@MEANING@};

/* The memory of the kernel stands behind the slave, as far aligned as that. */
static void *state_of(Slave *s) {
  const size_t unit = 16;
  return (char *)s + (sizeof(Slave) + unit - 1) / unit * unit;
}

static size_t slave_size(void) { return sizeof(Slave) + 16 + model_state_size(); }

static void begin(Slave *s) {
  memcpy(s->value, START, sizeof START);
  s->stale = 1, s->moved = 0;
  model_start(state_of(s));
}

/* The model asked for its outputs, after a step where there is one. */
static int asked(Slave *s, double step) {
#if UNDER_EFFORTS
  double *effort = s->value, *position = effort + SET, *velocity = position + MODEL_FREEDOMS, *reaction = velocity + MODEL_FREEDOMS;
  if (!s->moved) {
    const int status = model_begin(state_of(s), effort + MODEL_DRIVES);
    if (status) return status;
  }
  return model_step(state_of(s), step, effort, position, velocity, reaction);
#else
  double *q = s->value, *effort = q + SET, *position = effort + MODEL_DRIVES, *reaction = position + MODEL_FREEDOMS;
  (void)step;
  return model_solve(state_of(s), q, q + MODEL_DRIVES, q + 2 * MODEL_DRIVES, effort, reaction, position);
#endif
}

static Status solved(Slave *s, double step) {
  if (s->stale || (UNDER_EFFORTS && step > 0.0)) {
    s->stale = 0;
    s->result = asked(s, step);
    s->moved |= step > 0.0;
    if (s->result) {
      const double none = strtod("nan", NULL);
      for (int i = SET; i < SET + OUTPUTS; i++) s->value[i] = none;
      if (s->callbacks && s->callbacks->logger)
        s->callbacks->logger(s->callbacks->environment, s->name, DISCARD, "logStatusDiscard", "%s", MEANING[s->result]);
    }
  }
  return s->result ? DISCARD : OK;
}

EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }
EXPORT const char *fmi2GetVersion(void) { return "2.0"; }

EXPORT void *fmi2Instantiate(const char *name, int type, const char *guid, const char *resources, const Callbacks *callbacks, int visible,
                             int logging) {
  (void)resources, (void)visible, (void)logging;
  if (type != 1 || !guid || strcmp(guid, GUID) != 0) return NULL;
  Slave *s = calloc(1, slave_size());
  const size_t length = name ? strlen(name) + 1 : 1;
  char *own = calloc(1, length);
  if (!s || !own) {
    free(s), free(own);
    return NULL;
  }
  if (name) memcpy(own, name, length);
  s->callbacks = callbacks, s->name = own;
  begin(s);
  return s;
}

EXPORT void fmi2FreeInstance(Slave *s) {
  if (s) free(s->name);
  free(s);
}

EXPORT Status fmi2SetDebugLogging(Slave *s, int on, size_t count, const char *const categories[]) {
  (void)s, (void)on, (void)count, (void)categories;
  return OK;
}

EXPORT Status fmi2SetupExperiment(Slave *s, int has_tolerance, double tolerance, double start, int has_stop, double stop) {
  (void)s, (void)has_tolerance, (void)tolerance, (void)start, (void)has_stop, (void)stop;
  return OK;
}

EXPORT Status fmi2EnterInitializationMode(Slave *s) { return s ? OK : ERROR_; }
EXPORT Status fmi2ExitInitializationMode(Slave *s) { return s ? OK : ERROR_; }
EXPORT Status fmi2Terminate(Slave *s) { return s ? OK : ERROR_; }

EXPORT Status fmi2Reset(Slave *s) {
  begin(s);
  return OK;
}

EXPORT Status fmi2GetReal(Slave *s, const unsigned places[], size_t count, double values[]) {
  for (size_t i = 0; i < count; i++) {
    if (places[i] >= SET + OUTPUTS) return ERROR_;
    if (places[i] >= SET) solved(s, 0.0);
    values[i] = s->value[places[i]];
  }
  return OK;
}

EXPORT Status fmi2SetReal(Slave *s, const unsigned places[], size_t count, const double values[]) {
  for (size_t i = 0; i < count; i++) {
    if (places[i] >= (s->moved ? (unsigned)INPUTS : (unsigned)SET)) return ERROR_;
    s->value[places[i]] = values[i];
    s->stale = 1;
  }
  return OK;
}

EXPORT Status fmi2GetInteger(Slave *s, const unsigned places[], size_t count, int values[]) {
  for (size_t i = 0; i < count; i++) {
    if (places[i]) return ERROR_;
    solved(s, 0.0);
    values[i] = s->result;
  }
  return OK;
}

/* What there is no variable of, and what is not offered. */
#define NONE(name, ...) EXPORT Status name(__VA_ARGS__)
NONE(fmi2SetInteger, Slave *s, const unsigned places[], size_t count, const int values[]) { return (void)s, (void)places, (void)values, count ? ERROR_ : OK; }
NONE(fmi2GetBoolean, Slave *s, const unsigned places[], size_t count, int values[]) { return (void)s, (void)places, (void)values, count ? ERROR_ : OK; }
NONE(fmi2SetBoolean, Slave *s, const unsigned places[], size_t count, const int values[]) { return (void)s, (void)places, (void)values, count ? ERROR_ : OK; }
NONE(fmi2GetString, Slave *s, const unsigned places[], size_t count, const char *values[]) { return (void)s, (void)places, (void)values, count ? ERROR_ : OK; }
NONE(fmi2SetString, Slave *s, const unsigned places[], size_t count, const char *const values[]) { return (void)s, (void)places, (void)values, count ? ERROR_ : OK; }
NONE(fmi2SerializedFMUstateSize, Slave *s, void *kept, size_t *size) { return (void)s, (void)kept, (void)size, ERROR_; }
NONE(fmi2SerializeFMUstate, Slave *s, void *kept, char bytes[], size_t size) { return (void)s, (void)kept, (void)bytes, (void)size, ERROR_; }
NONE(fmi2DeSerializeFMUstate, Slave *s, const char bytes[], size_t size, void **kept) { return (void)s, (void)bytes, (void)size, (void)kept, ERROR_; }
NONE(fmi2GetDirectionalDerivative, Slave *s, const unsigned of[], size_t n_of, const unsigned by[], size_t n_by, const double d[], double out[]) {
  return (void)s, (void)of, (void)n_of, (void)by, (void)n_by, (void)d, (void)out, ERROR_;
}
NONE(fmi2SetRealInputDerivatives, Slave *s, const unsigned places[], size_t count, const int orders[], const double values[]) {
  return (void)s, (void)places, (void)count, (void)orders, (void)values, ERROR_;
}
NONE(fmi2GetRealOutputDerivatives, Slave *s, const unsigned places[], size_t count, const int orders[], double values[]) {
  return (void)s, (void)places, (void)count, (void)orders, (void)values, ERROR_;
}
NONE(fmi2CancelStep, Slave *s) { return (void)s, ERROR_; }
NONE(fmi2GetStatus, Slave *s, int kind, Status *value) { return (void)s, (void)kind, (void)value, DISCARD; }
NONE(fmi2GetRealStatus, Slave *s, int kind, double *value) { return (void)s, (void)kind, (void)value, DISCARD; }
NONE(fmi2GetIntegerStatus, Slave *s, int kind, int *value) { return (void)s, (void)kind, (void)value, DISCARD; }
NONE(fmi2GetBooleanStatus, Slave *s, int kind, int *value) { return (void)s, (void)kind, (void)value, DISCARD; }
NONE(fmi2GetStringStatus, Slave *s, int kind, const char **value) { return (void)s, (void)kind, (void)value, DISCARD; }

EXPORT Status fmi2GetFMUstate(Slave *s, void **kept) {
  if (!*kept) *kept = calloc(1, slave_size());
  if (!*kept) return ERROR_;
  memcpy(*kept, s, slave_size());
  return OK;
}

EXPORT Status fmi2SetFMUstate(Slave *s, void *kept) {
  char *own = s->name;
  memcpy(s, kept, slave_size());
  s->name = own;
  return OK;
}

EXPORT Status fmi2FreeFMUstate(Slave *s, void **kept) {
  (void)s;
  free(*kept);
  *kept = NULL;
  return OK;
}

/* The motion of the drives is that at the end of the step; efforts are held over it. */
EXPORT Status fmi2DoStep(Slave *s, double time, double step, int no_return) {
  (void)time, (void)no_return;
  return solved(s, step);
}

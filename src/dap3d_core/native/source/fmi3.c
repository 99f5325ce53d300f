/* Functional Mock-up Interface 3.0: co-simulation and model exchange. */

#define FMI(name) fmi3##name
#define FMI_STATE(before, behind) fmi3##before##FMUState##behind
#define FMI_READ_STATE fmi3DeserializeFMUState
#include "token.h"
#include "fmi.h"

typedef void (*logger3)(void *, int, const char *, const char *);

static void fmi_log(fmu *f, fmi_status status, const char *category, const char *words)
{
    if (f->logger != NULL && (f->logs || status >= fmi_error)) {
        logger3 log;
        memcpy(&log, &f->logger, sizeof log);
        log(f->environment, status, category, words);
    }
}

FMI_API const char *fmi3GetVersion(void) { return "3.0"; }

FMI_API S fmi3SetDebugLogging(I instance, bool on, size_t n, const char *const categories[])
{
    UNUSED(n), UNUSED(categories);
    F->logs = on;
    return fmi_ok;
}

static I instantiate(const char *name, const char *token, bool logs, void *environment,
                     logger3 logger, bool is_exchange)
{
    const char *refusal = fmi_refusal(name, token, is_exchange);
    if (refusal != NULL && logger != NULL)
        logger(environment, fmi_error, "logStatusError", refusal);
    fmu *f = refusal == NULL ? fmi_create(name) : NULL;
    if (f == NULL)
        return NULL;
    memcpy(&f->logger, &logger, sizeof logger);
    f->environment = environment;
    f->logs = logs;
    f->is_exchange = is_exchange;
    return f;
}

FMI_API I fmi3InstantiateModelExchange(const char *name, const char *token, const char *path,
                                       bool visible, bool logs, void *environment, logger3 logger)
{
    UNUSED(path), UNUSED(visible);
    return instantiate(name, token, logs, environment, logger, true);
}

FMI_API I fmi3InstantiateCoSimulation(const char *name, const char *token, const char *path,
                                      bool visible, bool logs, bool events, bool early,
                                      const R required[], size_t n, void *environment,
                                      logger3 logger, void *intermediate)
{
    UNUSED(path), UNUSED(visible), UNUSED(required), UNUSED(n);
    fmu *f = instantiate(name, token, logs, environment, logger, false);
    if (f != NULL) {
        f->early_return = early;
        f->has_events = events;
        f->intermediate = intermediate;
    }
    return f;
}

FMI_API I fmi3InstantiateScheduledExecution(const char *name, const char *token, const char *path,
                                            bool visible, bool logs, void *environment,
                                            logger3 logger, void *clock, void *lock, void *unlock)
{
    UNUSED(name), UNUSED(token), UNUSED(path), UNUSED(visible), UNUSED(logs), UNUSED(clock),
        UNUSED(lock), UNUSED(unlock);
    if (logger != NULL)
        logger(environment, fmi_error, "logStatusError", "there is no scheduled execution");
    return NULL;
}

FMI_API S fmi3EnterInitializationMode(I instance, bool has_tolerance, double tolerance,
                                      double start, bool has_stop, double stop)
{
    UNUSED(has_tolerance), UNUSED(tolerance);
    return fmi_setup(F, start, has_stop, stop);
}

FMI_API S fmi3EnterStepMode(I instance)
{
    UNUSED(instance);
    return fmi_ok;
}

FMI_API S fmi3EnterConfigurationMode(I instance)
{
    return fmi_failed(F, fmi_error, "there is no configuration mode");
}

FMI_API S fmi3ExitConfigurationMode(I instance) { return fmi3EnterConfigurationMode(instance); }

FMI_API S fmi3GetFloat64(I instance, const R r[], size_t n, double v[], size_t nv)
{
    return n == nv ? fmi_get(F, r, n, v) : fmi_failed(F, fmi_error, "all variables are scalars");
}

FMI_API S fmi3SetFloat64(I instance, const R r[], size_t n, const double v[], size_t nv)
{
    return n == nv ? fmi_set(F, r, n, v) : fmi_failed(F, fmi_error, "all variables are scalars");
}

/* There are no variables of other types. */
#define NONE(name, type)                                                                          \
    FMI_API S fmi3Get##name(I instance, const R r[], size_t n, type v[], size_t nv)               \
    {                                                                                             \
        UNUSED(r), UNUSED(v), UNUSED(nv);                                                         \
        return fmi_none(F, n);                                                                    \
    }                                                                                             \
    FMI_API S fmi3Set##name(I instance, const R r[], size_t n, const type v[], size_t nv)         \
    {                                                                                             \
        UNUSED(r), UNUSED(v), UNUSED(nv);                                                         \
        return fmi_none(F, n);                                                                    \
    }
NONE(Float32, float)
NONE(Int8, int8_t)
NONE(UInt8, uint8_t)
NONE(Int16, int16_t)
NONE(UInt16, uint16_t)
NONE(Int32, int32_t)
NONE(UInt32, uint32_t)
NONE(Int64, int64_t)
NONE(UInt64, uint64_t)
NONE(Boolean, bool)
NONE(String, text)

/* Functions of what there is none of; their arguments are not read. */
ABSENT(fmi3GetBinary, P, size_t, P, P, size_t)
ABSENT(fmi3SetBinary, P, size_t, P, P, size_t)
ABSENT(fmi3GetClock, P, size_t, P)
ABSENT(fmi3SetClock, P, size_t, P)
ABSENT(fmi3GetNumberOfVariableDependencies, R, P)
ABSENT(fmi3GetVariableDependencies, R, P, P, P, P, size_t)
ABSENT(fmi3GetAdjointDerivative, P, size_t, P, size_t, P, size_t, P, size_t)
ABSENT(fmi3GetIntervalDecimal, P, size_t, P, P)
ABSENT(fmi3GetIntervalFraction, P, size_t, P, P, P)
ABSENT(fmi3GetShiftDecimal, P, size_t, P)
ABSENT(fmi3GetShiftFraction, P, size_t, P, P)
ABSENT(fmi3SetIntervalDecimal, P, size_t, P)
ABSENT(fmi3SetIntervalFraction, P, size_t, P, P)
ABSENT(fmi3SetShiftDecimal, P, size_t, P)
ABSENT(fmi3SetShiftFraction, P, size_t, P, P)
ABSENT(fmi3GetOutputDerivatives, P, size_t, P, P, size_t)
ABSENT(fmi3ActivateModelPartition, R, double)

FMI_API S fmi3GetDirectionalDerivative(I instance, const R unknowns[], size_t count,
                                       const R knowns[], size_t given, const double seed[],
                                       size_t seeds, double result[], size_t results)
{
    if (seeds != given || results != count)
        return fmi_failed(F, fmi_error, "all variables are scalars");
    return fmi_directional(F, unknowns, count, knowns, given, seed, result);
}

FMI_API S fmi3EvaluateDiscreteStates(I instance)
{
    UNUSED(instance);
    return fmi_ok;
}

FMI_API S fmi3UpdateDiscreteStates(I instance, bool *again, bool *terminate, bool *nominals,
                                   bool *states, bool *has_next, double *next)
{
    S status = F->is_exchange && F->is_initialised ? fmi_event(F, states)
                                                   : (*states = false, fmi_ok);
    *again = *nominals = false;
    *terminate = F->is_terminated;
    *next = dap3d_next_event(F->model, F->model->t);
    *has_next = *next < INFINITY;
    return status;
}

/* ---------------------------------------------------------------------- model exchange */

FMI_API S fmi3CompletedIntegratorStep(I instance, bool no_set_state, bool *event, bool *terminate)
{
    UNUSED(no_set_state);
    *terminate = false;
    return fmi_completed(F, event);
}

FMI_API S fmi3GetContinuousStateDerivatives(I instance, double rates[], size_t n)
{
    return fmi_derivatives(F, rates, n);
}

FMI_API S fmi3GetNumberOfEventIndicators(I instance, size_t *n)
{
    UNUSED(instance);
    *n = SWITCHES;
    return fmi_ok;
}

FMI_API S fmi3GetNumberOfContinuousStates(I instance, size_t *n)
{
    UNUSED(instance);
    *n = STATES;
    return fmi_ok;
}

/* ---------------------------------------------------------------------- co-simulation */

/* The end of a step of the integrator within one of communication; as runtime.c's ``between``. */
static int between(void *instance, double t, double *end)
{
    void (*update)(void *, double, bool, bool, bool, bool, bool *, double *);
    bool early = false;
    double when = t;
    memcpy(&update, &F->intermediate, sizeof update);
    update(F->environment, t, false, true, true, F->early_return, &early, &when);
    if (!early || !F->early_return)
        return 0;
    *end = fmin(*end, when);
    return when <= t;
}

/* In event mode a step ends where a function of time takes another form, if it may; an event is
   also where a switch has crossed within the step: it has been handled. */
FMI_API S fmi3DoStep(I instance, double t, double h, bool no_set_state, bool *event,
                     bool *terminate, bool *early, double *last)
{
    UNUSED(no_set_state);
    double next = dap3d_next_event(F->model, dap3d_time(F->model)), end = t + h;
    int64_t before = crossings(F->model);
    bool is_due = F->has_events && next <= end;
    if (is_due && F->early_return)
        end = next;
    F->model->between = F->intermediate == NULL ? NULL : between;
    F->model->who = instance;
    S status = fmi_step(F, t, end, terminate);
    F->model->between = NULL;
    F->model->who = NULL;
    *last = dap3d_time(F->model);
    *event = F->has_events && ((is_due && *last >= next) || crossings(F->model) != before);
    *early = F->early_return && *last < t + h;
    return status;
}

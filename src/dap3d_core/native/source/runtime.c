/* The run of a model: time, inputs, outputs, states. What it runs is in data.h: memory of a run as it
   begins, and compiled functions; the integrators and equations are those that Python runs.

   It does what integrators/stepping/hold.py (inputs), simulation/handover.py (stiff scenes) and
   simulation/events/jumps.py and contact_jumps.py (velocities that jump) do, in the same order, for
   the same bits. */

#define DAP3D_BUILD
#include <float.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "dap3d.h"
#include "data.h"

enum { RHS, PROJECT, REPORT, ACCEPTED, WATCH };
/* Status of an integration (integration_state.py). */
enum { RUNNING, FINISHED, STEP_FLOOR, NOT_FINITE, PROJECTION_FAILED, SWITCHED, CHATTERED, ENDED,
       STIFF, JUMPED, STALLED, NO_ROOM, DRIVEN, NO_INERTIA };
#define HORIZON 1e5
#define ALIKE 1e-9
#define LARGEST 1e100
enum { GOES_ON, OVER, FAILED }; /* is_over */

struct dap3d_model {
    uint64_t identity;
    double t, t_end;         /* present time; end of the run */
    double span;             /* s, by which times of jumps are judged */
    double first_h;          /* of a hold: the step that it began with; -1: none has begun */
    int64_t first_rejected;
    int64_t which;           /* the integration that the run is in */
    int64_t is_ahead;        /* steps have gone beyond the present time, which is interpolated */
    double held[INPUTS + 1]; /* inputs of the last step */
    int64_t jump_count;
#if CONTACTS
    int64_t failure;         /* why contacts have no motion to go on with (decide.py) */
    int64_t change_count;    /* changes of modes, and when the latest were */
    double latest[MOST_CHANGES];
    int64_t stood;           /* steps up to a time, from which on they are too short where ... */
    double since;
#endif
    int64_t is_other;        /* 1: parameters that the start depends on are set; 2: it moves */
    int64_t has_begun;       /* what touches at the start has jumped */
    int64_t is_under_way;    /* states have been set, or events handled: it does not begin anew */
    int64_t has_row;         /* the row is that of the present time, and so are the outputs */
    int64_t is_over;
    int (*between)(void *, double, double *); /* called at ends of steps, while one is going on */
    void *who;
    char message[200];
    double sides[SWITCHES + 1]; /* of indicators, for integrators of others */
    double row[ROW + 1];     /* t, y and report at the present time */
    double outputs[OUTPUTS + 1];
    int64_t w[WORDS];        /* the memory of the run: the state of it ends here */
    double wide[DIRECTIONS ? 2 * WORDS : 1]; /* the same with slopes, for directional derivatives */
};

typedef void (*function)(double, const double *, int64_t, double *, int64_t, void *, void *);

static double *numbers(dap3d_model *m, int64_t word) { return (double *)(m->w + word); }

static double *real_of(dap3d_model *m) { return numbers(m, integrations[m->which].real); }

static int64_t *integer_of(dap3d_model *m) { return m->w + integrations[m->which].integer; }

static double *y_of(dap3d_model *m) { return numbers(m, integrations[m->which].state); }

static void call(dap3d_model *m, int k, double t, const double *y, double *out, int64_t size)
{
    function f = k == REPORT ? (function)REPORT_CODE : (function)(uintptr_t)m->w[FUNCTIONS + k];
    f(t, y, STATES, out, size, m->w + SYSTEM, m->w + LOOPS);
}

/* In place of a report, where integrations write rows: outputs have one where they are asked for. */
static void leave_out(double t, const double *y, int64_t states, double *out, int64_t size,
                      void *system, void *loops)
{
    (void)t, (void)y, (void)states, (void)system, (void)loops;
    memset(out, 0, 8 * (size_t)size);
}

/* Fill in the addresses of a run's memory, which has moved. */
static void place(dap3d_model *m)
{
    for (size_t k = 0; k < sizeof addresses / sizeof *addresses; k++)
        m->w[addresses[k][0]] = (int64_t)(uintptr_t)(m->w + addresses[k][1]);
    for (size_t k = 0; k < sizeof codes / sizeof *codes; k++)
        m->w[codes[k].word] = (int64_t)(uintptr_t)codes[k].code;
    if (!REPORTS)
        m->w[FUNCTIONS + REPORT] = (int64_t)(uintptr_t)leave_out;
}

static int fail(dap3d_model *m, int result, const char *words)
{
    snprintf(m->message, sizeof m->message, "%s", words);
    return result;
}

/* ---------------------------------------------------------------------- instances */

/* As stop_table of stepping/break_points.py, of a run to t_end: no stop behind it is needed. */
static void set_stops(dap3d_model *m)
{
    for (int i = 0; i < INTEGRATIONS; i++) {
        double *table = numbers(m, integrations[i].stops);
        int adaptive = numbers(m, integrations[i].real)[R_fixed_step] == 0.0;
        for (int k = 0; k < STOPS; k++) {
            int needed = stops[k].needs < m->t_end, jumps = needed && adaptive && stops[k].jumps;
            double t = needed ? stops[k].t : INFINITY;
            table[k] = jumps ? nextafter(t, -INFINITY) : t;
            table[STOPS + k] = t;
            table[2 * STOPS + k] = jumps ? nextafter(t, INFINITY) : t;
        }
    }
}

/* Hold the inputs as they are; whether they are others than before. */
static int take_inputs(dap3d_model *m)
{
    int differ = 0;
    for (int v = 1; v <= INPUTS; v++) { /* behind time */
        double value = *numbers(m, variables[v].first);
        differ |= value != m->held[v];
        m->held[v] = value;
    }
    return differ;
}

static void begin(dap3d_model *m, double t_end)
{
    const int64_t *next = content;
    memset(m, 0, offsetof(dap3d_model, wide));
    for (size_t k = 0; k < sizeof runs / sizeof *runs; k++, next += runs[k - 1][1])
        memcpy(m->w + runs[k][0], next, 8 * (size_t)runs[k][1]);
    place(m);
    m->identity = IDENTITY;
    m->t_end = t_end;
    m->first_h = -1.0;
    m->span = t_end;
    take_inputs(m);
    for (int k = 0; k < INTEGRATIONS; k++) {
        double *times = numbers(m, integrations[k].times);
        times[0] = 0.0;
        times[1] = times[2] = t_end;
        m->w[integrations[k].integer + I_next_report] = 1;
    }
    set_stops(m);
}

dap3d_model *dap3d_create(double t_end)
{
    if (t_end == 0.0)
        t_end = HORIZON;
    if (!(t_end > 0.0 && t_end <= LARGEST))
        return NULL;
    dap3d_model *m = malloc(sizeof *m);
    if (m != NULL)
        begin(m, t_end);
    return m;
}

void dap3d_free(dap3d_model *m) { free(m); }

void dap3d_reset(dap3d_model *m) { begin(m, m->t_end); }

const char *dap3d_message(const dap3d_model *m) { return m->message; }

/* ---------------------------------------------------------------------- variables */

int dap3d_count(void) { return VARIABLES; }

const char *dap3d_name(int v) { return v < 0 || v >= VARIABLES ? NULL : texts + variables[v].name; }

const char *dap3d_unit(int v) { return v < 0 || v >= VARIABLES ? NULL : texts + variables[v].unit; }

static int is_parameter(int v)
{
    int kind = v < 0 || v >= VARIABLES ? -1 : variables[v].kind;
    return kind == DAP3D_PARAMETER || kind == DAP3D_FIXED;
}

int dap3d_kind(int v) { return v < 0 || v >= VARIABLES ? -1 : variables[v].kind; }

int dap3d_find(const char *name)
{
    for (int v = 0; name != NULL && v < VARIABLES; v++)
        if (strcmp(texts + variables[v].name, name) == 0)
            return v;
    return -1;
}

#if CALLS
/* Let the loops of elements that outputs are of run at the bodies as reported. */
static void call_elements(dap3d_model *m)
{
    typedef void (*loop)(double, void *, int64_t, int64_t, int64_t, double *, double *, double *);
    for (int k = 0; k < MULTIPLIERS; k++)
        numbers(m, MINUS_LAMBDA)[m->w[ROW_OF + k]] = -m->row[MULTIPLIER + k];
    for (int k = 0; k < CALLS; k++) {
        double *x = numbers(m, VALUES_OF_ELEMENTS);
        loop code = (loop)(uintptr_t)m->w[calls[k].table + calls[k].q];
        memset(x + calls[k].out, 0, 8 * (size_t)calls[k].size);
        m->w[COUNTER] = 0;
        code(m->t, m->w + calls[k].arrays, calls[k].i0, calls[k].p0, 1, x + calls[k].out,
             x + calls[k].second, x + calls[k].third);
    }
}
#else
static void call_elements(dap3d_model *m) { (void)m; }
#endif

static void start(dap3d_model *m);

/* The row and the outputs of the present time. */
static void report(dap3d_model *m)
{
    start(m);
    if (m->has_row)
        return;
    if (!m->is_ahead)
        memcpy(m->row + 1, y_of(m), 8 * STATES);
    m->row[0] = m->t;
#if COMPLETES
    if (integer_of(m)[I_step_count] == 0) {
        m->w[STAGE] = START_ALONE;
        integrations[0].advance(m->w, 0);
    }
#endif
    call(m, REPORT, m->t, m->row + 1, m->row + 1 + STATES, ROW - 1 - STATES);
#if COMPLETES
    complete(m->w, m->row);
#endif
    for (int k = 0; k < ROW; k++)
        if (!(fabs(m->row[k]) <= DBL_MAX)) { /* the next step says so */
            integer_of(m)[I_status] = NOT_FINITE;
            real_of(m)[R_t_stop] = m->t;
        }
    call_elements(m);
    dap3d_outputs(numbers(m, BODIES), m->row + 1, numbers(m, VALUES),
                  numbers(m, VALUES_OF_ELEMENTS), m->outputs);
    m->has_row = 1;
}

static int restart_here(dap3d_model *m);

static void place_parameter(dap3d_model *m, int v, double x)
{
    for (int k = 0; k < variables[v].count; k++)
        *numbers(m, places[variables[v].first + k].word) = places[variables[v].first + k].sign * x;
}

/* Set a parameter before a run: it begins anew, with all that has been set. */
static void begin_with(dap3d_model *m, int v, double x)
{
    double values[VARIABLES];
    int64_t is_other = m->is_other;
    for (int k = 0; k < VARIABLES; k++)
        values[k] = variables[k].kind == DAP3D_INPUT || is_parameter(k) ? dap3d_get(m, k) : 0.0;
    begin(m, m->t_end);
    m->is_other = is_other;
#if FIXED
    m->is_other |= variables[v].kind == DAP3D_FIXED;
    for (size_t k = 0; k < sizeof moving / sizeof *moving; k++)
        m->is_other |= v == moving[k] ? 2 : 0;
#endif
    values[v] = x;
    for (int k = 0; k < VARIABLES; k++)
        if (is_parameter(k))
            place_parameter(m, k, values[k]);
    for (int k = 0; k < VARIABLES; k++) /* these change a run that begins with those of the scene */
        if (variables[k].kind == DAP3D_INPUT && values[k] != dap3d_get(m, k))
            dap3d_set(m, k, values[k]);
}

int dap3d_set(dap3d_model *m, int v, double x)
{
    int kind = dap3d_kind(v);
    if (kind < 0)
        return fail(m, DAP3D_INVALID, "there is no variable of such a reference");
    if ((kind != DAP3D_INPUT && !is_parameter(v)) || !(fabs(x) <= LARGEST))
        return fail(m, DAP3D_INVALID, "only inputs and parameters are set, to finite numbers");
    if (kind == DAP3D_INPUT) {
        start(m);
        double *value = numbers(m, variables[v].first);
        if (*value != x)
            m->has_row = 0;
        *value = x;
        return DAP3D_OK;
    }
    int k = variables[v].first, is_low = x < places[k].low;
    if (is_low || x > places[k].high) {
        snprintf(m->message, sizeof m->message, "%.80s = %.9g: %s", texts + variables[v].name, x,
                 texts + (is_low ? places[k].below : places[k].above));
        return DAP3D_INVALID;
    }
    double *value = numbers(m, places[k].word);
    if (*value == places[k].sign * x)
        return DAP3D_OK;
    int is_before = m->t == 0.0 && integer_of(m)[I_step_count] == 0 && !m->is_under_way;
    if (is_before && (m->has_begun || kind == DAP3D_FIXED))
        return begin_with(m, v, x), DAP3D_OK;
    if (kind == DAP3D_FIXED)
        return fail(m, DAP3D_INVALID, "this parameter is set before a run begins, and before its states are");
    int result = m->t > 0.0 ? restart_here(m) : DAP3D_OK;
    place_parameter(m, v, x);
    m->has_row = 0;
    return result;
}

double dap3d_get(dap3d_model *m, int v)
{
    int k = v < 0 || v >= VARIABLES ? 0 : variables[v].first;
    switch (dap3d_kind(v)) {
    case DAP3D_TIME: return m->t;
    case DAP3D_INPUT: return *numbers(m, k);
    case DAP3D_FIXED:
    case DAP3D_PARAMETER: return places[k].sign * *numbers(m, places[k].word);
    case DAP3D_OUTPUT: report(m); return m->outputs[k];
    case DAP3D_STATE: report(m); return m->row[1 + k];
    case DAP3D_DERIVATIVE: {
        double rates[STATES];
        report(m);
        call(m, RHS, m->t, m->row + 1, rates, STATES);
        return rates[k];
    }
    case DAP3D_INDICATOR: {
        double values[SWITCHES + 1];
        report(m);
        call(m, WATCH, m->t, m->row + 1, values, SWITCHES);
        return values[k];
    }
    default: return NAN;
    }
}

/* Whether parameters of which one has to be under the other are so: they are set one by one. */
static int are_ordered(dap3d_model *m)
{
    for (int k = 0; k < ORDERS; k++) {
        double low = dap3d_get(m, orders[k].low), high = dap3d_get(m, orders[k].high);
        if (low < high || (low == high && !orders[k].is_open))
            continue;
        snprintf(m->message, sizeof m->message, "%.60s = %.9g: should be %s %.60s = %.9g",
                 dap3d_name(orders[k].low), low, orders[k].is_open ? "less than" : "at most",
                 dap3d_name(orders[k].high), high);
        return 0;
    }
    return 1;
}

int dap3d_get_all(dap3d_model *m, const int *v, int count, double *values)
{
    for (int k = 0; k < count; k++) {
        if (dap3d_kind(v[k]) < 0)
            return fail(m, DAP3D_INVALID, "there is no such variable");
        values[k] = dap3d_get(m, v[k]);
    }
    return DAP3D_OK;
}

/* ---------------------------------------------------------------------- integration */

/* As Integration.restart. */
static void restart(dap3d_model *m)
{
    double *real = real_of(m);
    int64_t *integer = integer_of(m);
    real[R_h] = 0.0;
    real[R_last_error] = 1e-4;
    real[R_step_limit_at_switch] = INFINITY;
    integer[I_first_stage_valid] = integer[I_switch_rates_valid] = 0;
    integer[I_last_rejected] = integer[I_cut_attempts] = 0;
    memset(m->w + integrations[m->which].sides, 0, 8 * SWITCHES);
#if CONTACTS
    for (int k = 0; k < 2 * CONTACTS; k++)
        numbers(m, integrations[m->which].sides)[m->w[CONTACT_SWITCHES + k]] = 1.0;
#endif
}

/* As Integration.project: the state onto its constraints; whether that went well. */
static int project(dap3d_model *m)
{
    double *real = real_of(m);
    int64_t *integer = integer_of(m);
    real[R_projection_moved] = real[R_projection_outcome] = 0.0;
    integer[I_projection_count]++;
    call(m, PROJECT, real[R_t], y_of(m), real + R_projection_moved, PROJECTED);
    if (real[R_projection_outcome] != 1.0)
        return 1;
    real[R_t_stop] = real[R_t];
    integer[I_status] = PROJECTION_FAILED;
    return 0;
}

/* As hand_over of a scene that has become stiff: the implicit integration goes on. */
static int hand_over(dap3d_model *m)
{
    if (integer_of(m)[I_status] != STIFF || INTEGRATIONS < 2 || m->which != 0)
        return 0;
    double *before = real_of(m), *y = y_of(m), *times = numbers(m, integrations[0].times);
    int64_t next = integer_of(m)[I_next_report];
    m->which = 1;
    double *real = real_of(m);
    int64_t *integer = integer_of(m);
    memcpy(y_of(m), y, 8 * STATES);
    memcpy(numbers(m, integrations[1].times), times, 3 * 8);
    real[R_t] = before[R_t];
    integer[I_next_report] = next;
    real[R_t_stiff] = INFINITY;
    integer[I_status] = RUNNING;
    real[R_error_across_singularity] = real[R_failed_error_rate] = 0.0;
    integer[I_near_singular_landings] = integer[I_stalled_steps] = 0;
    integer[I_stiff_steps] = integer[I_nonstiff_steps] = integer[I_attempt_count] = 0;
    real[R_t_attempted] = before[R_t];
    integer[I_stall_start] = integer[I_rhs_count];
    restart(m);
    return 1;
}

/* ---------------------------------------------------------------------- jumps */

#if JUMPS
/* As Jumps._set_sides: sides of the switches after a jump; of one that goes back, where it goes. */
static void set_sides(dap3d_model *m)
{
    double *real = real_of(m), *y = y_of(m), *sides = numbers(m, integrations[m->which].sides);
    double span = fmax(m->span, fabs(real[R_t])), h = 1e-8 * span, t = real[R_t], one = 1.0;
    double slope[STATES], later[STATES], values[SWITCHES + 1], ahead[SWITCHES + 1];
    call(m, RHS, t, y, slope, STATES);
    call(m, WATCH, t, y, values, SWITCHES);
    for (int k = 0; k < STATES; k++)
        later[k] = y[k] + h * slope[k];
    call(m, WATCH, t + h, later, ahead, SWITCHES);
    for (int k = 0; k < SWITCHES; k++) {
        double rate = (ahead[k] - values[k]) / h;
        int at_once = fabs(values[k]) <= 1e-10 * span * fabs(rate);
        double side = at_once ? (rate > 0.0) - (rate < 0.0) : numbers(m, JUMP_SIDES)[k];
        sides[k] = m->w[DOES_JUMP + k] ? side : 0.0;
    }
    if (integer_of(m)[I_calls_accepted])
        call(m, ACCEPTED, t, y, &one, 1);
}

/* As Jumps._jump: velocities jump at the present state; whether that went well, and *acted. */
static int let_jump(dap3d_model *m, const double *crossing, const double *sides, int *acted)
{
    double *j = numbers(m, JUMP_REAL);
    *acted = 0;
    memcpy(numbers(m, JUMP_CROSSING), crossing, 8 * SWITCHES);
    memset(numbers(m, JUMP_SIDES), 0, 8 * SWITCHES);
    if (sides != NULL)
        memcpy(numbers(m, JUMP_SIDES), sides, 8 * SWITCHES);
    memcpy(numbers(m, JUMP_Y), y_of(m), 8 * STATES);
    j[J_soon] = 1e-13 * fmax(m->span, fabs(real_of(m)[R_t]));
    m->w[JUMP_INTEGER + JI_has_sides] = sides != NULL;
    m->w[JUMP_INTEGER + JI_given_count] = m->w[JUMP_INTEGER + JI_follows] = 0;
    jump_law(real_of(m)[R_t], m->w);
    if (m->w[JUMP_INTEGER + JI_missed] != -1)
        return 0;
    for (int k = 0; k < ELEMENTS; k++)
        *acted |= m->w[JUMP_ACTING + k] != 0;
    if (*acted) {
        memcpy(y_of(m), numbers(m, JUMP_Y), 8 * STATES);
        restart(m);
        set_sides(m);
    }
    return 1;
}

#endif

#if CONTACTS
enum { PRESCRIBED = 1, JAMMED, OVERLAPS, PUSHES, WEDGED, ENDLESS, SLOWLY };

/* As ContactJumps._go_on: the state that was decided on becomes that of the run. */
static void take_decided(dap3d_model *m)
{
    double rates[STATES];
    memcpy(y_of(m), numbers(m, CONTACT_Y), 8 * STATES);
    restart(m);
    call(m, RHS, real_of(m)[R_t], y_of(m), rates, STATES);
}

/* As ContactJumps._resolve: what contacts do at the present state, where switches have crossed, if
   any; whether that went well. */
static int let_touch(dap3d_model *m, const double *crossing, int starts)
{
    for (int c = 0; c < CONTACTS; c++)
        numbers(m, CONTACT_LIMIT)[c] =
            (starts ? TOUCHING_AT_START : TOUCHING) * numbers(m, CONTACT_LENGTH)[c] /
            numbers(m, CONTACT_ARM)[c];
    for (int k = 0; k < 2 * CONTACTS; k++)
        m->w[CONTACT_ENDED + k] = crossing != NULL && crossing[m->w[CONTACT_SWITCHES + k]] != 0.0;
    m->w[CONTACT_INTEGER + CI_starts] = starts;
    memcpy(numbers(m, CONTACT_Y), y_of(m), 8 * STATES);
    m->failure = contact_law(real_of(m)[R_t], m->w);
    if (m->failure)
        return 0;
    take_decided(m);
    return 1;
}

/* As ContactJumps._refuse_endless: whether modes change ever faster. */
static int are_endless(dap3d_model *m)
{
    double t = real_of(m)[R_t], span = fmax(m->span, fabs(t));
    int rattles = m->w[CONTACT_INTEGER + CI_freed] > MOST_JAMS;
    m->latest[m->change_count++ % MOST_CHANGES] = t;
    if (m->change_count < MOST_CHANGES
        || t - m->latest[m->change_count % MOST_CHANGES] > (rattles ? RATTLING : WITHIN) * span)
        return 0;
    m->failure = ENDLESS;
    return 1;
}

/* As ContactJumps.follow: the run ends where steps have become too short. Python may find there that
   slip jams, and go on. */
static void end_slow_run(dap3d_model *m)
{
    double t = real_of(m)[R_t];
    int64_t steps = integer_of(m)[I_step_count];
    if (t - m->since > SLOW * fmax(m->span, fabs(t)) || steps < m->stood) {
        m->stood = steps;
        m->since = t;
    } else if (steps - m->stood > MOST_STEPS && integer_of(m)[I_status] == RUNNING) {
        m->failure = SLOWLY;
        real_of(m)[R_t_stop] = t;
        integer_of(m)[I_status] = JUMPED;
    }
}

/* Why contacts have no motion to go on with. */
static void say_failure(dap3d_model *m, double t)
{
    static const char *const words[] = {
        "", " closes, and joints or drivers prescribe the motion of its bodies",
        " jams: its friction presses the bodies together by more than it lets them give way",
        ": its bodies overlap at the start", " would drive: its friction is negative",
        " jams: an impact has no impulse within the cone of its friction. Try law = poisson", "s change ever faster",
        IMPLICIT ? "s slip and turn by next to nothing, or rattle: slip jams again and again. Try smaller mu"
        : "s ask for ever shorter steps, as slow slip does. Export with integrator radau, or try smaller mu"};
    int has_name = m->failure < ENDLESS;
    const char *name = has_name ? contact_names[m->w[CONTACT_INTEGER + CI_culprit]] : "";
    int rattles = m->failure == ENDLESS && m->w[CONTACT_INTEGER + CI_freed] > MOST_JAMS;
    snprintf(m->message, sizeof m->message, "the run stopped at t = %.9g s: contact%s%s%s", t,
             has_name ? " " : "", name,
             rattles ? "s rattle: slip jams again and again. Try smaller mu" : words[m->failure]);
}
#endif

#if FIXED
static void table_call(dap3d_model *m, int64_t word, double t, double *y, double *out, int64_t size)
{
    function f = (function)(uintptr_t)m->w[word];
    f(t, y, STATES, out, size, m->w + SYSTEM, m->w + LOOPS);
}

/* True if factor J + shift 1 is positive definite, by its leading minors. */
static int is_positive(const double *J, double factor, double shift)
{
    double a = factor * J[0] + shift, b = factor * J[4] + shift, c = factor * J[8] + shift;
    double d = factor * J[3], e = factor * J[6], f = factor * J[7], minor = a * b - d * d;
    return a > 0.0 && minor > 0.0 && c * minor - a * f * f - b * e * e + 2.0 * d * e * f > 0.0;
}

/* The metric of a body, of its mass and inertia: 1/sqrt(m), and U = L^-T with J' = L L^T; whether
   that is an inertia, of which none of three principal ones exceeds the sum of the others. */
static int weigh(dap3d_model *m, int b)
{
    const double *x = numbers(m, BODIES) + BODY_WIDTH * b, *J = x + BODY_JP;
    double *k = numbers(m, METRIC) + METRIC_WIDTH * b;
    double largest = fmax(J[0], fmax(J[4], J[8])), half = 0.5 * (J[0] + J[4] + J[8]);
    /* as scene/validate/bodies.py; half - J is that of the mass along the axes */
    if (!is_positive(J, 1.0, -1e-14 * largest) || !is_positive(J, -1.0, half + 5e-10 * largest))
        return 0;
    double a = sqrt(J[0]), c = J[3] / a, d = J[6] / a, e = sqrt(J[4] - c * c);
    double f = (J[7] - d * c) / e, g = sqrt(J[8] - d * d - f * f);
    k[0] = 1.0 / sqrt(x[BODY_MASS]);
    k[1] = 1.0 / a, k[4] = 1.0 / e, k[6] = 1.0 / g;
    k[2] = 0.0 - c * k[1] * k[4];
    k[5] = 0.0 - f * k[4] * k[6];
    k[3] = 0.0 - (d * k[1] + f * k[2]) * k[6];
    return 1;
}

/* The least and the greatest moment of inertia of a body about its centre of mass. */
static void find_moments(const double *J, double *least, double *most)
{
    double size = fmax(J[0], fmax(J[4], J[8])), mean = (J[0] + J[4] + J[8]) / size / 3.0;
    double a = J[0] / size - mean, b = J[4] / size - mean, c = J[8] / size - mean;
    double d = J[3] / size, e = J[6] / size, f = J[7] / size;
    *least = fmin(J[0], fmin(J[4], J[8]));
    *most = size;
    if (d == 0.0 && e == 0.0 && f == 0.0)
        return;
    double spread = sqrt((a * a + b * b + c * c + 2.0 * (d * d + e * e + f * f)) / 6.0);
    double minor = a * (b * c - f * f) - d * (d * c - e * f) + e * (d * f - b * e);
    double angle = acos(fmax(-1.0, fmin(1.0, 0.5 * minor / (spread * spread * spread)))) / 3.0;
    *least = size * (mean + 2.0 * spread * cos(angle + 2.0943951023931953));
    *most = size * (mean + 2.0 * spread * cos(angle));
}

/* As mass_flags of formulations/arrays.py and Model.part_size: how much masses and inertias differ. */
static void compare_masses(dap3d_model *m)
{
    double moments[2] = {INFINITY, 0.0}, masses[2] = {INFINITY, 0.0}, gyration = 0.0, low, high;
    for (int b = 1; b <= BODY_COUNT; b++) {
        const double *x = numbers(m, BODIES) + BODY_WIDTH * b;
        find_moments(x + BODY_JP, &low, &high);
        moments[0] = fmin(moments[0], low), moments[1] = fmax(moments[1], high);
        masses[0] = fmin(masses[0], x[BODY_MASS]), masses[1] = fmax(masses[1], x[BODY_MASS]);
        gyration = fmax(gyration, sqrt(high / x[BODY_MASS]));
    }
    double size = fmin(EXTENT, fmax(ARM, gyration));
    low = fmin(masses[0], moments[0] / (size * size));
    high = fmax(masses[1], moments[1] / (size * size));
    *numbers(m, IS_EVEN) = masses[1] > UNEVEN * masses[0];
    *numbers(m, IS_WEAK) = high > VERY_UNEVEN * low;
}

#if COMPLETES
/* Inverses of mass and principal moments of inertia of a body, for steps of contacts. */
static void invert(dap3d_model *m, int b)
{
    numbers(m, MASS_INVERSE)[b] = 1.0 / numbers(m, MASS)[b];
    for (int k = 9 * b; k < 9 * b + 9; k += 4)
        numbers(m, JP_INVERSE)[k] = 1.0 / numbers(m, JP)[k];
}

/* As _put_carried of integrators/moreau/arrays.py: what joints hold at bodies that are far lighter. */
static void put_carried(dap3d_model *m)
{
    enum { SIZE = 2 * (BODY_COUNT + 1) };
    double own[SIZE] = {0.0}, felt[SIZE], carried[SIZE], passed[SIZE], *found = numbers(m, CARRIED);
    for (int b = 1; b <= BODY_COUNT; b++) {
        own[2 * b] = numbers(m, MASS)[b];
        find_moments(numbers(m, JP) + 9 * b, passed, own + 2 * b + 1);
    }
    memcpy(carried, own, sizeof own);
    do {
        m->w[LIGHT_COUNT] = 0;
        for (int k = 0; k < SIZE; k += 2) {
            int light = own[k] < LIGHT * carried[k] || own[k + 1] < LIGHT * carried[k + 1];
            memcpy(felt + k, (light ? carried : own) + k, 16);
            found[k] = light ? 1.0 / carried[k] : 0.0;
            found[k + 1] = light ? 1.0 / carried[k + 1] : 0.0;
            m->w[LIGHT_COUNT] += light;
        }
        memcpy(passed, carried, sizeof carried);
        memcpy(carried, felt, sizeof felt);
        for (int row = 0; row < JOINT_ROWS; row++) {
            const int64_t *body = m->w + ROW_BODY, first = m->w[ROW_START + row];
            for (int64_t p = first; p < m->w[ROW_START + row + 1]; p++)
                for (int64_t q = first; q < m->w[ROW_START + row + 1]; q++)
                    for (int c = 0; c < 2; c++)
                        carried[2 * body[p] + c] = fmax(carried[2 * body[p] + c], felt[2 * body[q] + c]);
        }
    } while (memcmp(carried, passed, sizeof carried) != 0);
}
#endif

/* The state that the scene gives. */
static void take_given(dap3d_model *m, double *y)
{
    const double *u = numbers(m, GIVEN), *v = u + 7 * BODY_COUNT;
    double *rates = y + 7 * BODY_COUNT;
    memcpy(y, u, 8 * 13 * BODY_COUNT);
    memcpy(y + 13 * BODY_COUNT, u + 13 * BODY_COUNT, 8 * ELEMENT_STATES);
    for (int b = 0; b < BODY_COUNT; b++) { /* w' = A^T w */
        const double *e = u + 7 * b + 3, *w = v + 6 * b + 3;
        double *own = rates + 6 * b + 3, c[3], d[3], *p = own;
        c[0] = e[2] * w[2] - e[3] * w[1];
        c[1] = e[3] * w[0] - e[1] * w[2];
        c[2] = e[1] * w[1] - e[2] * w[0];
        d[0] = e[2] * c[2] - e[3] * c[1];
        d[1] = e[3] * c[0] - e[1] * c[2];
        d[2] = e[1] * c[1] - e[2] * c[0];
        for (int k = 0; k < 3; k++)
            p[k] = w[k] - 2.0 * e[0] * c[k] + 2.0 * d[k];
    }
}

/* The start with the parameters that it depends on; RUNNING, or why there is none. */
static int find_start(dap3d_model *m)
{
    double *y = y_of(m), *k = numbers(m, METRIC), kept[7 * (BODY_COUNT + 1)], none[1] = {0.0};
    compare_masses(m);
    if (m->is_other & 2)
        take_given(m, y);
    if ((m->is_other & 2) && ASSEMBLES) {
        double *out = numbers(m, STARTING);
        for (int b = 1; b <= BODY_COUNT; b++) {
            memcpy(kept + 7 * b, k + METRIC_WIDTH * b, 8 * 7);
            memcpy(k + METRIC_WIDTH * b, numbers(m, UNIT), 8 * 7);
        }
        table_call(m, BEGIN + 1, 0.0, y, out, STARTING_SIZE);
        for (int b = 1; b <= BODY_COUNT; b++)
            memcpy(k + METRIC_WIDTH * b, kept + 7 * b, 8 * 7);
        if (out[START_OPEN] != 0.0 || !(out[START_PIVOT] > 1e-10))
            return PROJECTION_FAILED;
    }
    for (size_t n = 0; n < sizeof heavy / sizeof *heavy; n++)
        if (heavy[n] > 0) {
            if (!weigh(m, heavy[n]))
                return NO_INERTIA;
#if COMPLETES
            invert(m, heavy[n]);
#endif
        }
#if COMPLETES
    put_carried(m);
#endif
    table_call(m, BEGIN, 0.0, y, none, 0);
    for (int n = 1; n < INTEGRATIONS; n++)
        memcpy(numbers(m, integrations[n].state), y, 8 * STATES);
    return RUNNING;
}
#endif

/* Let what touches and approaches at the start jump there. */
static void jump_at_start(dap3d_model *m)
{
    (void)m;
#if JUMPS
    double none[SWITCHES + 1] = {0.0};
    int acted;
    if (!let_jump(m, none, NULL, &acted)) {
        integer_of(m)[I_status] = JUMPED;
        real_of(m)[R_t_stop] = real_of(m)[R_t];
    }
#endif
#if CONTACTS
    if (!let_touch(m, NULL, 1)) {
        integer_of(m)[I_status] = JUMPED;
        real_of(m)[R_t_stop] = real_of(m)[R_t];
    }
#endif
}

/* Find the start, and let what touches and approaches jump there, once. */
static void start(dap3d_model *m)
{
    if (m->has_begun)
        return;
    m->has_begun = 1;
#if FIXED
    int status = m->is_other ? find_start(m) : RUNNING;
    if (status != RUNNING) {
        integer_of(m)[I_status] = status;
        real_of(m)[R_t_stop] = 0.0;
        return;
    }
#endif
    jump_at_start(m);
}

/* As Jumps.apply, where an integration has stopped for it; whether it goes on. */
static int apply_jump(dap3d_model *m)
{
#if JUMPS
    if (integer_of(m)[I_status] == JUMPED) {
        double *sides = numbers(m, integrations[m->which].sides), crossing[SWITCHES], before[SWITCHES];
        int acted;
        m->jump_count++;
        memcpy(before, sides, sizeof before);
        memcpy(crossing, sides + CROSSED_BEHIND_SIDES, sizeof crossing);
        memset(sides + CROSSED_BEHIND_SIDES, 0, sizeof crossing);
        if (let_jump(m, crossing, before, &acted)) {
            integer_of(m)[I_status] = RUNNING;
            return 1;
        }
        real_of(m)[R_t_stop] = real_of(m)[R_t];
    }
#endif
#if CONTACTS
    if (integer_of(m)[I_status] == JUMPED && !m->failure) {
        double *sides = numbers(m, integrations[m->which].sides), crossing[SWITCHES];
        m->jump_count++;
        memcpy(crossing, sides + CROSSED_BEHIND_SIDES, sizeof crossing);
        memset(sides + CROSSED_BEHIND_SIDES, 0, sizeof crossing);
        for (int k = 0; k < 2 * CONTACTS; k++)
            sides[COUNT_BEHIND_SIDES + m->w[CONTACT_SWITCHES + k]] = 0.0;
        if (!are_endless(m) && let_touch(m, crossing, 0)) {
            integer_of(m)[I_status] = RUNNING;
            return 1;
        }
        real_of(m)[R_t_stop] = real_of(m)[R_t];
    }
#endif
    return hand_over(m);
}

static void advance(dap3d_model *m, int64_t budget)
{
    integrations[m->which].advance(m->w, budget);
#if CONTACTS
    end_slow_run(m);
#endif
}

/* The run has stopped short of a time. */
static int stopped(dap3d_model *m)
{
    static const char *const words[] = {
        "", "the run has reached its end", "the error requires a step that time cannot resolve",
        "rates or a state are not finite", "no state on the constraints was found",
        "a switch of the model ended the run", "a switch changed its sign again and again", "",
        "the scene is stiff", "joints hold a velocity that is to jump", "steps are so short that the run would not end",
        "more contacts came near than the model has room for", "friction of a contact is negative",
        "inertias of a body should be positive, and none greater than the sum of the others"};
    int64_t status = integer_of(m)[I_status];
    double t = status == FINISHED ? real_of(m)[R_t] : real_of(m)[R_t_stop];
    m->is_over = status == SWITCHED || status == FINISHED ? OVER : FAILED;
#if CONTACTS
    if (status == JUMPED)
        return say_failure(m, t), DAP3D_ERROR;
#endif
    snprintf(m->message, sizeof m->message, "the run stopped at t = %.9g s: %s", t,
             words[status >= 0 && status <= NO_INERTIA ? status : 0]);
    return m->is_over == FAILED ? DAP3D_ERROR : DAP3D_ENDED;
}

/* At the end of a step, before that of a call: whether the call ends here; *end may become earlier. */
static int pauses(dap3d_model *m, double *end)
{
    if (m->between == NULL || real_of(m)[R_t] >= *end || integer_of(m)[I_status] != RUNNING)
        return 0;
    m->t = real_of(m)[R_t];
    m->has_row = m->is_ahead = 0;
    return m->between(m->who, m->t, end);
}

/* The run has stopped before a report: its present time is where that was. */
static int stopped_here(dap3d_model *m)
{
    m->t = real_of(m)[R_t];
    m->has_row = m->is_ahead = 0;
    return stopped(m);
}

/* Integrate beyond a time, and interpolate there: as a run with reports. */
static int step_freely(dap3d_model *m, double t)
{
    for (int k = 0; k < INTEGRATIONS; k++)
        numbers(m, integrations[k].times)[1] = t;
    integer_of(m)[I_next_report] = 1;
    integer_of(m)[I_row_count] = 0;
    if (integer_of(m)[I_status] == FINISHED)
        integer_of(m)[I_status] = RUNNING; /* the last step has reached the end, and reported it */
    if (integer_of(m)[I_status] == JUMPED && !apply_jump(m))
        return stopped_here(m);
    if (real_of(m)[R_t] >= t)
        advance(m, -1); /* no step */
    while (integer_of(m)[I_row_count] == 0) {
        if (integer_of(m)[I_status] != RUNNING && !apply_jump(m))
            return stopped_here(m);
        advance(m, 0);
        if (integer_of(m)[I_row_count] == 0 && pauses(m, &t))
            return DAP3D_OK;
        numbers(m, integrations[m->which].times)[1] = t;
    }
    double *row = numbers(m, integrations[m->which].rows);
    memcpy(m->row, row, 8 * ROW);
    m->t = row[0];
    m->is_ahead = real_of(m)[R_t] != m->t;
    m->has_row = 0; /* outputs are not known yet */
    if (m->t < t)
        return stopped(m);
    m->is_over = m->t == m->t_end ? OVER : GOES_ON;
    return DAP3D_OK;
}

/* ---------------------------------------------------------------------- holds of inputs */

#if DRIVES && !CONTACTS
static double kinetic_energy(dap3d_model *m)
{
    double total = 0.0, report_of[ROW];
    call(m, REPORT, real_of(m)[R_t], y_of(m), report_of, ROW - 1 - STATES);
    for (int b = 1; b <= BODY_COUNT; b++) {
        const double *x = numbers(m, BODIES) + BODY_WIDTH * b, *v = x + BODY_V, *w = x + BODY_W;
        const double *A = x + BODY_A, *J = x + BODY_JP;
        double own[3], sum = x[BODY_MASS] * (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
        for (int k = 0; k < 3; k++)
            own[k] = A[k] * w[0] + A[k + 3] * w[1] + A[k + 6] * w[2];
        for (int k = 0; k < 3; k++)
            sum += own[k] * (J[3 * k] * own[0] + J[3 * k + 1] * own[1] + J[3 * k + 2] * own[2]);
        total += 0.5 * sum;
    }
    return total;
}

#endif

/* As Hold.jump and sampled.jump: inputs have changed. */
static int jump(dap3d_model *m)
{
    double *real = real_of(m), h = real[R_h];
    int64_t *integer = integer_of(m);
    if (integrations[m->which].keeps_step && !SWITCHES && real[R_fixed_step] == 0.0) {
        integer[I_first_stage_valid] = 0;
        real[R_last_error] = 1e-4;
    } else {
        restart(m);
        integer[I_segment_step] = integer[I_segment_step_count] = 0;
        if (integrations[m->which].keeps_step)
            real[R_h] = h;
    }
#if DRIVES && CONTACTS /* as ContactJumps.set_state */
    memcpy(numbers(m, CONTACT_Y), y_of(m), 8 * STATES);
    follow_drivers(real[R_t], m->w);
    take_decided(m);
#elif DRIVES /* velocities jump with a driver; what that takes is work */
    double before = kinetic_energy(m);
    if (!project(m))
        return stopped(m);
    y_of(m)[STATES - 1] += kinetic_energy(m) - before;
#endif
#if CONTACTS
    if (!let_touch(m, NULL, 0)) { /* what touches lifts, slips or sticks by the forces that act then */
        integer[I_status] = JUMPED;
        real[R_t_stop] = real[R_t];
        return stopped(m);
    }
#endif
    return DAP3D_OK;
}

/* As Hold.to: integrate with steps that end at a time. */
static int hold_to(dap3d_model *m, double end)
{
    int result = take_inputs(m) ? jump(m) : DAP3D_OK;
    if (result != DAP3D_OK)
        return result;
    m->first_h = real_of(m)[R_h];
    m->first_rejected = integer_of(m)[I_rejected_count];
    integer_of(m)[I_row_count] = 0;
    for (;;) {
        int64_t status = integer_of(m)[I_status];
        if (real_of(m)[R_t] >= end && (status == RUNNING || status == FINISHED))
            break;
        if (status != RUNNING) {
            if (status == JUMPED && apply_jump(m))
                continue;
            if (!hand_over(m))
                return stopped_here(m);
            m->first_h = real_of(m)[R_h];
            m->first_rejected = integer_of(m)[I_rejected_count];
        }
        real_of(m)[R_t_limit] = end;
        advance(m, m->between == NULL ? 1000 : 0);
        real_of(m)[R_t_limit] = INFINITY;
        if (pauses(m, &end))
            end = real_of(m)[R_t];
    }
    double *real = real_of(m);
    int64_t *integer = integer_of(m);
    m->t = end;
    m->has_row = m->is_ahead = 0;
    if (integer[I_status] == FINISHED) {
        m->is_over = OVER;
        return DAP3D_OK;
    }
    real[R_t] = end; /* as Hold.land */
    if (real[R_h] < m->first_h && integer[I_rejected_count] == m->first_rejected)
        real[R_h] = m->first_h;
    m->first_h = -1.0;
    return DAP3D_OK;
}

double dap3d_time(const dap3d_model *m) { return m->t; }

/* Crossings of switches so far, those where velocities jump included. */
static int64_t crossings(dap3d_model *m)
{
    int64_t count = m->jump_count;
    for (int k = 0; k < INTEGRATIONS; k++)
        count += m->w[integrations[k].integer + I_crossing_count];
    return count;
}

int dap3d_step_to(dap3d_model *m, double t)
{
    m->message[0] = 0;
    if (!(t > m->t))
        return t == m->t ? DAP3D_OK
                         : fail(m, DAP3D_INVALID, "time goes forward only; load a saved state");
    if (m->is_over == FAILED)
        return stopped(m);
    if (m->is_over) {
        snprintf(m->message, sizeof m->message, "the run has ended at t = %.9g s", m->t);
        return DAP3D_ENDED;
    }
    if (t <= LARGEST && fabs(t - m->t_end) <= ALIKE * (t - m->t))
        t = m->t_end;
    if (t > m->t_end)
        return fail(m, DAP3D_INVALID, "the time is beyond the end that dap3d_create was given");
    if (!are_ordered(m))
        return DAP3D_INVALID;
    start(m);
    if (INPUTS > 0) /* its end is open: a usual number of such steps */
        m->span = fmin(1000.0 * (t - m->t), m->t_end);
    return INPUTS > 0 ? hold_to(m, t) : step_freely(m, t);
}

/* ---------------------------------------------------------------------- states of a run */

size_t dap3d_state_size(void) { return offsetof(dap3d_model, wide); }

int dap3d_save(const dap3d_model *m, void *state)
{
    memcpy(state, m, dap3d_state_size());
    return DAP3D_OK;
}

int dap3d_load(dap3d_model *m, const void *state)
{
    uint64_t identity;
    memcpy(&identity, state, sizeof identity);
    if (identity != IDENTITY)
        return fail(m, DAP3D_INVALID, "the state is not one of this model");
    memcpy(m, state, dap3d_state_size());
    place(m);
    return DAP3D_OK;
}

/* ---------------------------------------------------------------------- equations */

int dap3d_state_count(void) { return STATES; }

int dap3d_states(const dap3d_model *model, double *y)
{
    dap3d_model *m = (dap3d_model *)model; /* which begins where it has not */
    start(m);
    memcpy(y, m->is_ahead ? m->row + 1 : y_of(m), 8 * STATES);
    return DAP3D_OK;
}

/* Let steps begin anew at the present time. */
static int restart_here(dap3d_model *m)
{
    if (m->is_ahead)
        return dap3d_set_states(m, m->t, m->row + 1);
    restart(m);
    return DAP3D_OK;
}

int dap3d_set_states(dap3d_model *m, double t, const double *y)
{
    for (int k = 0; k < STATES; k++)
        if (!(fabs(y[k]) <= LARGEST))
            return fail(m, DAP3D_INVALID, "a state is not finite");
    start(m);
    if (!(t >= 0.0 && t <= m->t_end * (1.0 + ALIKE))) /* sums of steps round */
        return fail(m, DAP3D_INVALID, "the time is not one of the run");
    double *real = real_of(m);
    memmove(y_of(m), y, 8 * STATES);
    m->t = real[R_t] = t;
    m->is_under_way = 1;
    m->has_row = m->is_ahead = 0;
    m->is_over = GOES_ON;
#if CONTACTS /* changes and steps behind t are those of another course */
    m->failure = m->change_count = 0;
    m->stood = integer_of(m)[I_step_count];
    m->since = t;
#endif
    integer_of(m)[I_status] = RUNNING;
    integer_of(m)[I_next_report] = 1;
#if COMPLETES
    *numbers(m, PUSHED) = 0.0; /* contacts of the state before push no more */
#endif
    integer_of(m)[I_segment_step] = integer_of(m)[I_segment_step_count] = 0;
    restart(m);
    if (integer_of(m)[I_calls_accepted]) {
        double moved = real[R_projection_moved];
        real[R_projection_moved] = 1.0; /* as count_turns, from the start of a step */
        call(m, ACCEPTED, t, y_of(m), real + R_projection_moved, PROJECTED);
        real[R_projection_moved] = moved;
    }
    return DAP3D_OK;
}

int dap3d_derivatives(dap3d_model *m, double t, const double *y, double *rates)
{
    if (COMPLETES) /* equations without contacts would be another model */
        return fail(m, DAP3D_INVALID, "steps follow contacts here: states have no derivatives");
    if (!are_ordered(m))
        return DAP3D_INVALID;
    start(m); /* which weighs the bodies */
    call(m, RHS, t, y, rates, STATES);
    for (int k = 0; k < STATES; k++)
        if (!(fabs(rates[k]) <= LARGEST))
            return fail(m, DAP3D_ERROR, "the rates are not finite");
    return DAP3D_OK;
}

#if DIRECTIONS
/* The memory with slopes zero. */
static void widen(dap3d_model *m)
{
    for (int k = 0; k < WORDS; k++) {
        m->wide[2 * k] = numbers(m, 0)[k];
        m->wide[2 * k + 1] = 0.0;
    }
    int64_t *x = (int64_t *)m->wide;
    for (size_t k = 0; k < sizeof wide_addresses / sizeof *wide_addresses; k++) {
        const uint32_t *a = wide_addresses[k];
        x[a[0]] = (int64_t)(uintptr_t)(a[2] == 2 ? (void *)(m->wide + a[1]) : (void *)(m->w + a[1]));
    }
    for (size_t k = 0; k < sizeof wide_shapes / sizeof *wide_shapes; k++)
        x[wide_shapes[k][0]] = wide_shapes[k][1];
    for (size_t k = 0; k < sizeof wide_codes / sizeof *wide_codes; k++)
        x[wide_codes[k].word] = (int64_t)(uintptr_t)wide_codes[k].code;
}
#endif

int dap3d_directional(dap3d_model *m, const int *unknowns, int count, const int *knowns, int given,
                      const double *seed, double *result)
{
#if DIRECTIONS
    double *x = m->wide, *row = x + 2 * ALONG_ROW;
    report(m);
    widen(m);
    for (int k = 0; k < ROW; k++)
        row[2 * k] = m->row[k], row[2 * k + 1] = 0.0;
    for (int k = 0; k < given; k++) {
        int v = knowns[k], first = v < 0 || v >= VARIABLES ? 0 : variables[v].first;
        switch (dap3d_kind(v)) {
        case DAP3D_TIME: row[1] += seed[k]; break;
        case DAP3D_STATE: row[2 * (1 + first) + 1] += seed[k]; break;
        case DAP3D_INPUT: x[2 * first + 1] += seed[k]; break;
        case DAP3D_PARAMETER:
            for (int n = 0; n < variables[v].count; n++)
                x[2 * places[first + n].word + 1] += places[first + n].sign * seed[k];
            break;
        default: return fail(m, DAP3D_INVALID, "there is no derivative by such a variable");
        }
    }
    int needs = 0;
    for (int k = 0; k < count; k++) {
        int kind = dap3d_kind(unknowns[k]);
        if (kind == DAP3D_OUTPUT && variables[unknowns[k]].is_mean)
            return fail(m, DAP3D_INVALID, "a mean of a step of contacts has no derivative");
        needs |= kind == DAP3D_OUTPUT ? 2 : kind == DAP3D_DERIVATIVE;
    }
#if !COMPLETES
    if (needs & 1)
        rates_along(x);
#endif
    if (needs & 2) {
        report_along(x);
#if CALLS
        double *values = x + 2 * VALUES_OF_ELEMENTS;
        memset(values, 0, 16 * (size_t)(COUNTER - VALUES_OF_ELEMENTS + 1));
        for (int k = 0; k < MULTIPLIERS; k++)
            for (int c = 0; c < 2; c++)
                x[2 * (MINUS_LAMBDA + m->w[ROW_OF + k]) + c] = -row[2 * (MULTIPLIER + k) + c];
        for (int k = 0; k < CALLS; k++)
            memset(values + 2 * calls[k].out, 0, 16 * (size_t)calls[k].size);
#endif
        elements_along(x);
        dap3d_outputs_along(x + 2 * BODIES, row + 2, x + 2 * VALUES, x + 2 * VALUES_OF_ELEMENTS,
                            x + 2 * ALONG_OUT);
    }
    for (int k = 0; k < count; k++) {
        int v = unknowns[k], first = v < 0 || v >= VARIABLES ? 0 : variables[v].first;
        switch (dap3d_kind(v)) {
        case DAP3D_OUTPUT: result[k] = x[2 * (ALONG_OUT + first) + 1]; break;
        case DAP3D_DERIVATIVE: result[k] = x[2 * (ALONG_RATES + first) + 1]; break;
        case DAP3D_STATE: result[k] = row[2 * (1 + first) + 1]; break;
        default: return fail(m, DAP3D_INVALID, "there is no derivative of such a variable");
        }
    }
    return DAP3D_OK;
#else
    (void)unknowns, (void)count, (void)knowns, (void)given, (void)seed, (void)result;
    return fail(m, DAP3D_INVALID, "the model calls a function without a derivative");
#endif
}

int dap3d_project(dap3d_model *m, double t, double *y, double *moved)
{
    double out[PROJECTED + 1] = {0.0}, before[STATES], largest = 0.0;
    memcpy(before, y, sizeof before);
    start(m);
    if (integer_of(m)[I_projects])
        call(m, PROJECT, t, y, out, PROJECTED);
    for (int k = 0; k < STATES; k++)
        largest = fmax(largest, fabs(y[k] - before[k]));
    if (moved != NULL)
        *moved = largest;
    return out[1] == 1.0 ? fail(m, DAP3D_ERROR, "no state on the constraints was found") : DAP3D_OK;
}

#if JUMPS
static int does_jump(dap3d_model *m, int k) { return m->w[DOES_JUMP + k] != 0; }
#elif CONTACTS
static int does_jump(dap3d_model *m, int k)
{
    for (int c = 0; c < 2 * CONTACTS; c++)
        if (m->w[CONTACT_SWITCHES + c] == k)
            return 1;
    return 0;
}
#endif

int dap3d_event(dap3d_model *m, int *changed)
{
    double y[STATES], moved;
    if (!are_ordered(m))
        return DAP3D_INVALID;
    dap3d_states(m, y);
    m->is_under_way = 1;
    if (dap3d_project(m, m->t, y, &moved) != DAP3D_OK)
        return DAP3D_ERROR;
    *changed = moved > 0.0;
    if (moved > 0.0 && dap3d_set_states(m, m->t, y) != DAP3D_OK)
        return DAP3D_ERROR;
#if JUMPS || CONTACTS
    double values[SWITCHES], crossing[SWITCHES];
    int acted = 1, crosses = 0;
    dap3d_indicators(m, m->t, y, values);
    for (int k = 0; k < SWITCHES; k++) {
        double side = (values[k] > 0.0) - (values[k] < 0.0);
        crossing[k] = does_jump(m, k) && side * m->sides[k] < 0.0 ? side : 0.0;
        m->sides[k] = crossing[k] != 0.0 || m->sides[k] == 0.0 ? side : m->sides[k];
        crosses |= crossing[k] != 0.0;
    }
    if (crosses) {
#if CONTACTS
        if (!let_touch(m, crossing, 0))
            return say_failure(m, m->t), DAP3D_ERROR;
#else
        if (!let_jump(m, crossing, m->sides, &acted))
            return fail(m, DAP3D_ERROR, "joints hold a velocity that is to jump");
#endif
        if (acted)
            memcpy(m->sides, numbers(m, integrations[m->which].sides), sizeof values);
        m->has_row = 0;
        *changed |= acted;
    }
#endif
    return DAP3D_OK;
}

int dap3d_indicator_count(void) { return SWITCHES; }

int dap3d_indicators(dap3d_model *m, double t, const double *y, double *values)
{
    start(m);
    if (SWITCHES)
        call(m, WATCH, t, y, values, SWITCHES);
    return DAP3D_OK;
}

double dap3d_next_event(const dap3d_model *m, double t)
{
    for (int k = 0; k < STOPS; k++)
        if (stops[k].jumps && stops[k].t > t && stops[k].needs < m->t_end)
            return stops[k].t;
    return INFINITY;
}

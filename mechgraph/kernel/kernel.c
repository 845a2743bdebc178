/* mechgraph kernel: see kernel.h for the tables.
 *
 * A state is evaluated along the spanning tree: poses of links, twists of all freedoms, and what every chord leaves open of its loop. One
 * elimination of the closure matrix, rows chosen by pivots, serves Newton, rates, accelerations and, transposed, the loop wrenches of the
 * forces (reciprocity: J^T x = tau - S^T w_tree). A path is a chain of certified steps, see `certified`; positions are read off them.
 * Passive freedoms: rows of a border keep increments across their motions, along a step links are brought to where they are at rest.
 * Sources: Featherstone, Rigid Body Dynamics Algorithms, 2008, chapters 5 and 8; Allgower and Georg, Introduction to Numerical Continuation
 * Methods, 2003, chapters 2 and 6.
 */
#include "kernel.h"

#include <math.h>
#include <string.h>

/* What only decides and is no result: real where all else is complex, for derivatives (derivative.c). */
#ifndef MGK_COMPLEX
typedef double magnitude;
#define REAL_PART(x) (x)
#endif

/* Tolerances; those of the package in maths/tolerances.py have the same names there. */
static const magnitude CLOSED = 1e-14;      /* closure residual that Newton aims at, over the distance from the origin */
static const magnitude PASSED = 1e-9;       /* the same of a place that is only passed: 4 FAIR PASSED < ALONE / FAIR */
static const magnitude ACCEPTED = 1e-12;    /* residual that counts as closed where rounding lets it come no nearer */
static const magnitude CORRECTION = 0.06;   /* largest correction that a prediction may need */
static const magnitude REUSED = 1e-5;       /* correction below which the factors before it serve for the next one */
static const magnitude FAIR = 3e3;          /* condition number above which nothing is decided here */
static const magnitude DEPARTURE = 0.5;     /* largest change of the closure matrix over a step, against its inverse at the end */
static const magnitude ALONE = 0.05;        /* part of the inverse condition, over rates, up to which another branch is not as near */
static const magnitude LONGEST = 0.7;       /* longest step */
static const magnitude REACHED = 3;         /* how far a curve through places close together is followed, over their distance */
static const magnitude STEADY = 1e3;        /* acceleration over rate squared up to which a motion tells the bend of the line it follows */
static const magnitude NEAREST = 0.7;       /* longest step over that on which the closure matrix changes by as much as it is */
static const magnitude SHORTEST = 2e-3;     /* step below which the careful follower of the package takes over */
static const magnitude INDEPENDENT = 1e-9;  /* part of the closure rates that drives may leave open */
static const magnitude DRIVERS_ALONE = 1e-9;/* part below which the reactions of a self-stress count as none */
static const magnitude UNIQUE = 1e-7;       /* part of a self-stress in a component above which it is not unique */
static const magnitude STILL = 1e-8;        /* part of a passive motion above which it moves other links */
static const magnitude UNSWUNG = 0.25;      /* way of a rotation vector, over that to a whole turn, on which its axis does not swing round */
static const magnitude UNTURNED = 1e-13;    /* angle that is rounding */
static const magnitude MISSING = 1e-9;      /* angle, or length / L, that may be missing to rest */
static const magnitude TURNING = 1e-11;     /* part of the fastest rate up to which a freedom is at rest, and friction has no direction */
static const magnitude NEWTON_DONE = 1e-14;  /* part of the normal forces by which they may be off */
static const magnitude SETTLED = 1e-12;     /* part of the reactions up to which places of contact have settled */
static const magnitude OFF_TABLE = 1e-9;     /* part of a table's length up to which a place beyond its end is on it by rounding */
static const magnitude STRAIGHT_ON = 1e-12; /* change of direction up to which a polygon goes straight on */
enum { ITERATIONS = 8, MOST_STEPS = 20000, MOST_TURNS = 8, POINTS = 8, TOLD = 8, POWERS = 8, SEVERAL = 4, MOST_NEWTON = 60, MOST_ROUNDS = 50, MOST_TURNED = 4, AT_ONCE = 20 }; /* AT_ONCE: positions a step from which on nearer nodes cost less than corrections */

#define FOR(i, n) for (int i = 0; i < (n); i++)

/* --- tables and memory ------------------------------------------------------------------------------------------------------------- */

typedef struct {
  int links, pairs, factors, columns, states, loops, steps, couplings, terms, drives, unknowns, loads, frame_link, rows, stresses, passives, held, part, height, rubs, lines, line_steps, belts;
  const int *first, *kind, *column, *state, *number, *ends, *walk, *chord, *loop_first, *loop_pair, *loop_sign, *owner, *column_state,
      *is_length, *place, *effort_factor, *effort_at_b, *dual, *drive, *unknown, *term_first, *term_column, *passive_first, *passive_link, *turns, *line, *line_first, *line_step, *belt_first, *belt_coupling, *load;
  const double *unit, *origin, *start, *start_coordinates, *frame, *marker_a, *marker_b, *factor_number, *effort, *mass, *center,
      *inertia, *base, *border, *coefficient, *constant, *line_wrench, *belt_part, *pretension, *load_number;
} Model;

/* A place on the path: state, rates and accelerations along the way, the closure matrix, its rate along the way, the inverse C^-1 of its
 * independent rows and C^-1 C', and how far it changes by as much as it is, of first order. */
typedef struct {
  double *x, *rate, *bend, *matrix, *matrix_rate, *inverse, *change, *at, *passive, *twist, *pose, condition, reach;
  int *row;
} Node;

/* Hermite's polynomial in increments from the state x at a place: coefficients [POWERS] of every freedom, lowest first, in parts of `length`;
 * it is not asked for beyond `until`. */
typedef struct {
  const double *x;
  double *coefficient, at, length, until;
} Curve;

typedef struct {
  /* kept between calls: state, drives, and where rotation vectors of the user stand */
  double *x, *drive, *axis, *angle, *begun, *border;
  /* evaluation of one state */
  double *pose, *frame, *end, *S, *residual, *middle;
  magnitude reach, closure;
  /* elimination */
  double *lu, *inverse;
  int *row;
  /* rates and forces */
  double *dq, *ddq, *V, *A, *bias, *G, *chord_V, *pair_twist, *E, *applied, *inertial, *total, *reaction, *carried, *given, *tau, *coupled, *multiplier;
  double *stress, *size, *row_value, *column_value, *trial, *increment, *there, *change, *bound, *record, *direction, *line_begin, *asked, *kept;
  /* passive motions: unit rates, twists with their rates, velocity parts, links at rest in them; along a step, what is missing to rest */
  double *passive, *twist, *twist_rate, *own_bias, *moving_bias, *moving, *raw, *apart, *trial_rate, *trial_acceleration, *still, *series;
  /* friction: rates that tell its directions; answers (reactions, efforts, multipliers) without it, as they press, and of unit efforts; of
   * every place what it reads of an answer, the wrenches that it exerts for a unit of its normal force and vector, these as efforts in the
   * pairs that they would pass and what these take up; efforts and what pairs take up of all, of them those of teeth, and their wrenches */
  double *slip, *smooth, *pressing, *unit, *nothing, *reads, *exerts, *own, *takes, *linear, *slope, *sized, *normal, *vector, *sliding, *rubbed, *taken, *bare, *teeth, *beside, *rubbing;
  /* first row and first part of every place, its load; pairs and senses of the parts; pairs whose unit efforts are answered; whether the
   * second line of a coupling acts, that of a negative multiplier */
  int *row_of, *part_of, *answered, *flank;
  magnitude single, told, allowed, corrected, *speed;
  size_t n_kept;
  Node a, b, before;
  /* the last two places on the line that are closed to rounding, and the curve through them to node b (none: x NULL); that of a step */
  Node last, other;
  Curve curve, arc;
  int known, stands; /* stands: node a is closed and factored at the state kept, and nothing else has been evaluated */
  long steps, evaluations, factorizations;
} Work;

static void read_tables(const int *I, const double *P, Model *m) {
  *m = (Model){0};
  m->links = I[MGK_LINKS], m->pairs = I[MGK_PAIRS], m->factors = I[MGK_FACTORS], m->columns = I[MGK_COLUMNS];
  m->states = I[MGK_STATES], m->loops = I[MGK_LOOPS], m->steps = I[MGK_STEPS], m->couplings = I[MGK_COUPLINGS];
  m->terms = I[MGK_TERMS], m->drives = I[MGK_DRIVES], m->unknowns = I[MGK_UNKNOWNS], m->loads = I[MGK_LOADS];
  m->frame_link = I[MGK_FRAME], m->passives = I[MGK_PASSIVES], m->part = I[MGK_FIRST_PART], m->height = I[MGK_LOOP_ROWS], m->rubs = I[MGK_RUBS], m->lines = I[MGK_LINES], m->line_steps = I[MGK_LINE_STEPS], m->belts = I[MGK_BELTS];
  m->held = m->height * m->loops + m->couplings;
  m->rows = m->held + m->passives, m->stresses = m->rows - m->unknowns - m->belts;
  const int p = m->pairs, f = m->factors, c = m->columns, n = m->links, *i = I + MGK_HEAD;
  m->first = i, i += p + 1, m->kind = i, i += f, m->column = i, i += f + 1, m->state = i, i += f, m->number = i, i += f;
  m->ends = i, i += 2 * p, m->walk = i, i += 4 * (p - m->loops), m->chord = i, i += m->loops;
  m->loop_first = i, i += m->loops + 1, m->loop_pair = i, i += m->steps, m->loop_sign = i, i += m->steps;
  m->owner = i, i += c, m->column_state = i, i += c, m->is_length = i, i += c, m->place = i, i += c;
  m->effort_factor = i, i += c, m->effort_at_b = i, i += c, m->dual = i, i += p;
  m->drive = i, i += m->drives, m->unknown = i, i += m->unknowns;
  m->term_first = i, i += m->couplings + 1, m->term_column = i, i += m->terms;
  m->passive_first = i, i += m->passives + 1, m->passive_link = i, i += I[MGK_PASSIVE_LINKS], m->turns = i, i += m->passives;
  m->line = i, i += 2 * m->lines, m->line_first = i, i += m->lines + 1, m->line_step = i, i += 2 * m->line_steps;
  m->belt_first = i, i += m->belts + 1, m->belt_coupling = i, i += I[MGK_BELT_SPANS], m->load = i;
  if (!P) return;
  const double *d = P;
  m->unit = d, d += 1, m->origin = d, d += 3, m->start = d, d += m->states, m->start_coordinates = d, d += c, m->frame = d, d += 12;
  m->marker_a = d, d += 12 * p, m->marker_b = d, d += 12 * p, m->factor_number = d, d += I[MGK_FACTOR_NUMBERS];
  m->effort = d, d += 6 * c, m->mass = d, d += n, m->center = d, d += 3 * n, m->inertia = d, d += 6 * n, m->base = d, d += 12 * n;
  m->border = d, d += c * m->passives;
  m->coefficient = d, d += m->terms, m->constant = d, d += m->couplings, m->line_wrench = d, d += 12 * m->lines;
  m->belt_part = d, d += I[MGK_BELT_SPANS], m->pretension = d, d += m->belts, m->load_number = d;
}

/* The first freedom of a pair. */
static int first_column(const Model *m, int pair) { return m->column[m->first[pair]]; }

static double *taken(double **memory, size_t *size, size_t count) {
  double *out = *memory;
  if (out) *memory += count;
  *size += count;
  return out;
}

/* The memory of a state laid out; its size in bytes. */
static size_t lay_out(const Model *m, double *memory, Work *w) {
  size_t size = 0, c = m->columns, n = m->links, p = m->pairs, r = m->rows, u = m->unknowns, s = m->rows > m->unknowns ? m->rows - m->unknowns : 0, q = m->passives;
  int places[MGK_PARTS + 1];
#define TAKE(name, count) w->name = taken(&memory, &size, (count))
  TAKE(x, m->states), TAKE(drive, m->drives), TAKE(axis, 3 * m->factors), TAKE(angle, m->factors), TAKE(begun, m->factors), TAKE(border, q * c);
  w->n_kept = size;
  TAKE(kept, w->n_kept);
  TAKE(pose, 12 * n), TAKE(frame, 12 * m->factors), TAKE(end, 12 * p), TAKE(S, 6 * c), TAKE(residual, r), TAKE(middle, 3 * m->loops);
  TAKE(lu, r * u), TAKE(inverse, u * u);
  w->row = (int *)taken(&memory, &size, r);
  TAKE(dq, c), TAKE(ddq, c), TAKE(V, 6 * n), TAKE(A, 6 * n), TAKE(bias, 6 * p), TAKE(G, 6 * c), TAKE(chord_V, 6 * m->loops), TAKE(pair_twist, 6 * p), TAKE(E, 6 * c);
  TAKE(applied, 6 * n), TAKE(inertial, 6 * n), TAKE(total, 6 * p), TAKE(carried, 6 * n), TAKE(given, c);
  TAKE(reaction, 6 * p), TAKE(tau, c), TAKE(multiplier, m->couplings), TAKE(coupled, c), TAKE(stress, (6 * p + c + m->couplings) * s), TAKE(size, s);
  TAKE(row_value, r), TAKE(column_value, c), TAKE(trial, m->states), TAKE(increment, c), TAKE(there, 6 * c), TAKE(change, u * u), TAKE(bound, 4 * u);
  TAKE(passive, q * c), TAKE(twist, 6 * q), TAKE(twist_rate, 6 * q), TAKE(own_bias, 6 * p * q), TAKE(moving_bias, q ? 6 * p : 0), TAKE(moving, 6 * q);
  w->speed = (magnitude *)taken(&memory, &size, n);
  TAKE(raw, 6 * q * q + q), TAKE(apart, 2 * q * q), TAKE(trial_rate, q ? c : 0), TAKE(trial_acceleration, q ? c : 0), TAKE(still, m->drives), TAKE(series, POINTS * q);
  w->curve.coefficient = taken(&memory, &size, POWERS * c), w->arc.coefficient = taken(&memory, &size, POWERS * c);
  Node *nodes[5] = {&w->last, &w->other, &w->a, &w->b, &w->before};
  FOR(i, 5) {
    nodes[i]->x = taken(&memory, &size, m->states), nodes[i]->rate = taken(&memory, &size, c), nodes[i]->bend = taken(&memory, &size, c);
    nodes[i]->at = taken(&memory, &size, 1);
    if (i < 2) continue;
    nodes[i]->matrix = taken(&memory, &size, r * u), nodes[i]->matrix_rate = taken(&memory, &size, r * u);
    nodes[i]->inverse = taken(&memory, &size, u * u), nodes[i]->change = taken(&memory, &size, u * u), nodes[i]->row = (int *)taken(&memory, &size, u);
    nodes[i]->passive = taken(&memory, &size, q * c), nodes[i]->twist = taken(&memory, &size, 6 * q), nodes[i]->pose = taken(&memory, &size, 12 * q);
  }
  TAKE(direction, m->drives), TAKE(line_begin, m->drives), TAKE(asked, 3 * m->drives);
  int head[MGK_HEAD] = {0};
  head[MGK_LINKS] = m->links, head[MGK_PAIRS] = m->pairs, head[MGK_COLUMNS] = m->columns, head[MGK_STATES] = m->states;
  head[MGK_LOOPS] = m->loops, head[MGK_COUPLINGS] = m->couplings, head[MGK_UNKNOWNS] = m->unknowns, head[MGK_PASSIVES] = m->passives;
  head[MGK_LOOP_ROWS] = m->height, head[MGK_RUBS] = m->rubs, head[MGK_BELTS] = m->belts;
  mgk_record(head, places);
  TAKE(record, places[MGK_PARTS]);
  const size_t R = m->rubs, moved = R ? c : 0, pairs = R ? 6 * p : 0, all = R ? 6 * p + c + m->couplings : 0, parts = R ? R + m->line_steps : 0;
  TAKE(slip, moved), TAKE(smooth, all), TAKE(pressing, all), TAKE(unit, all * c), TAKE(nothing, R ? 6 * n : 0), TAKE(reads, 18 * R), TAKE(exerts, 24 * R), TAKE(own, 24 * parts), TAKE(takes, 24 * parts);
  TAKE(linear, 3 * R * (4 * R + 1)), TAKE(slope, R * (R + 1)), TAKE(sized, R * R), TAKE(normal, R), TAKE(vector, 3 * R + 2 * R), TAKE(sliding, R), TAKE(rubbed, moved), TAKE(taken, pairs), TAKE(bare, 6 * n);
  TAKE(teeth, moved), TAKE(beside, pairs), TAKE(rubbing, R ? 6 * m->couplings : 0);
  w->row_of = (int *)taken(&memory, &size, 3 * R + 2), w->part_of = (int *)taken(&memory, &size, 2 * parts), w->answered = (int *)taken(&memory, &size, R ? p : 0);
  w->flank = (int *)taken(&memory, &size, m->lines);
#undef TAKE
  return size * sizeof(double);
}

int mgk_record(const int *I, int *places) {
  const int c = I[MGK_COLUMNS], n = I[MGK_LINKS], p = I[MGK_PAIRS], k = I[MGK_COUPLINGS], q = I[MGK_PASSIVES], R = I[MGK_RUBS];
  const int s = I[MGK_LOOP_ROWS] * I[MGK_LOOPS] + k + q - I[MGK_UNKNOWNS] - I[MGK_BELTS];
  const int lengths[MGK_PARTS] = {I[MGK_STATES], c, c, c, 1, 2, 3 * p, 6 * p, c, c, 6 * n, 6 * p * s, c * s, c, k, k * s, c * s, 6, 1, 1, q ? 6 * n : 0, q, q, R ? c : 0, R ? 6 * p : 0, R, R, R ? c : 0, R ? 6 * k : 0, R > 0};
  places[0] = 0;
  FOR(i, MGK_PARTS) places[i + 1] = places[i] + lengths[i];
  return MGK_OK;
}

size_t mgk_state_size(const int *I) {
  Model m;
  Work w;
  read_tables(I, NULL, &m);
  return lay_out(&m, NULL, &w);
}

/* --- vectors, poses, twists -------------------------------------------------------------------------------------------------------- */

/* The larger one; what is no number stays, so that it passes no limit. */
static magnitude raised(magnitude most, magnitude value) { return ((value > most) | (value != value)) ? value : most; }

static magnitude size_of(const double *v, int n) {
  magnitude most = 0.0, sum = 0.0;
  FOR(i, n) {
    const magnitude size = fabs(v[i]);
    most = size > most ? size : most, sum += size;
  }
  return most + (sum - sum); /* what is no number stays */
}

static void cross(const double *a, const double *b, double *out) {
  const double x = a[1] * b[2] - a[2] * b[1], y = a[2] * b[0] - a[0] * b[2], z = a[0] * b[1] - a[1] * b[0];
  out[0] = x, out[1] = y, out[2] = z;
}

static inline double dot(const double *a, const double *b, int n) { /* by four sums, which do not wait for each other */
  double sum[4] = {0};
  int i = 0;
  for (; i + 4 <= n; i += 4) FOR(k, 4) sum[k] += a[i + k] * b[i + k];
  for (int k = 0; i < n; i++, k++) sum[k] += a[i] * b[i];
  return (sum[0] + sum[1]) + (sum[2] + sum[3]);
}

/* y += part x */
static inline void add_part(int n, double part, const double *restrict x, double *restrict y) { FOR(i, n) y[i] += part * x[i]; }

static void turned(const double *X, const double *v, double *out) {
  FOR(i, 3) out[i] = X[4 * i] * v[0] + X[4 * i + 1] * v[1] + X[4 * i + 2] * v[2];
}

static void turned_back(const double *X, const double *v, double *out) {
  FOR(i, 3) out[i] = X[i] * v[0] + X[4 + i] * v[1] + X[8 + i] * v[2];
}

static void point_of(const double *X, const double *v, double *out) {
  turned(X, v, out);
  FOR(i, 3) out[i] += X[4 * i + 3];
}

static void row_product(const double *restrict a, const double *restrict B, double *restrict out) {
  FOR(j, 4) out[j] = a[0] * B[j] + a[1] * B[4 + j] + a[2] * B[8 + j];
  out[3] += a[3];
}

static void product(const double *A, const double *B, double *out) {
  row_product(A, B, out), row_product(A + 4, B, out + 4), row_product(A + 8, B, out + 8);
}

static void product_back(const double *A, const double *B, double *out) { /* A B^-1 */
  FOR(i, 3) {
    FOR(j, 3) out[4 * i + j] = A[4 * i] * B[4 * j] + A[4 * i + 1] * B[4 * j + 1] + A[4 * i + 2] * B[4 * j + 2];
    out[4 * i + 3] = A[4 * i + 3];
    FOR(j, 3) out[4 * i + 3] -= out[4 * i + j] * B[4 * j + 3];
  }
}

/* ad(V) S: the rate of a twist that moves with a body of twist V */
static void moved_twist(const double *V, const double *S, double *out) {
  double part[3];
  cross(V, S, out);
  cross(V, S + 3, out + 3);
  cross(V + 3, S, part);
  FOR(i, 3) out[3 + i] += part[i];
}

/* A twist about the origin, taken about a point. */
static void twist_about(const double *S, const double *point, double *out) {
  cross(S, point, out + 3);
  FOR(i, 3) out[i] = S[i], out[3 + i] += S[3 + i];
}

/* A wrench about a point (sign 1: taken about the origin; -1: the other way round), in place. */
static void wrench_moved(double *w, const double *point, double sign) {
  double arm[3];
  cross(point, w + 3, arm);
  FOR(i, 3) w[i] += sign * arm[i];
}

/* --- factors ----------------------------------------------------------------------------------------------------------------------- */

/* X <- X D(q) of a factor, or X D(q)^-1 where sense is -1 */
static void passed(const Model *m, int f, const double *x, double sense, double *X) {
  const int kind = m->kind[f];
  const double *q = x + m->state[f], *number = m->factor_number + m->number[f];
  if (kind == MGK_POSE) {
    double Y[12];
    (REAL_PART(sense) > 0 ? product : product_back)(X, number, Y);
    memcpy(X, Y, sizeof Y);
  } else if (kind >= MGK_SLIDE && kind < MGK_ROTATION) {
    FOR(r, 3) X[4 * r + 3] += sense * *q * X[4 * r + kind - MGK_SLIDE];
  } else if (kind < MGK_SLIDE) {
    const int i = (kind + 1) % 3, j = (kind + 2) % 3;
    const double s = sense * sin(*q), c = cos(*q), along = sense * *number * *q;
    FOR(r, 3) {
      double *row = X + 4 * r;
      const double u = row[i], v = row[j];
      row[i] = c * u + s * v, row[j] = c * v - s * u, row[3] += along * row[kind];
    }
  } else {
    const double w = q[0], a = sense * q[1], b = sense * q[2], c = sense * q[3];
    const double R[9] = {1 - 2 * (b * b + c * c), 2 * (a * b - w * c), 2 * (a * c + w * b), 2 * (a * b + w * c), 1 - 2 * (a * a + c * c),
                         2 * (b * c - w * a), 2 * (a * c - w * b), 2 * (b * c + w * a), 1 - 2 * (a * a + b * b)};
    FOR(r, 3) {
      const double u = X[4 * r], v = X[4 * r + 1], z = X[4 * r + 2];
      FOR(j, 3) X[4 * r + j] = u * R[j] + v * R[3 + j] + z * R[6 + j];
    }
  }
}

/* The twists of a factor, X being the frame before it. */
static void twists_of(const Model *m, int f, const double *X, double *S) {
  const int kind = m->kind[f];
  const double at[3] = {X[3], X[7], X[11]};
  for (int c = m->column[f]; c < m->column[f + 1]; c++) {
    double *s = S + 6 * c;
    const int axis = kind == MGK_ROTATION ? c - m->column[f] : kind % 3;
    const double line[3] = {X[axis], X[4 + axis], X[8 + axis]};
    if (kind >= MGK_SLIDE && kind < MGK_ROTATION) {
      FOR(i, 3) s[i] = 0.0, s[3 + i] = line[i];
      continue;
    }
    memcpy(s, line, sizeof line);
    cross(at, line, s + 3);
    if (kind < MGK_SLIDE) FOR(i, 3) s[3 + i] += m->factor_number[m->number[f]] * line[i];
  }
}

/* Along a pair, X being the frame of marker A (forward) or B: its frames and twists; X is the frame at the other side afterwards. */
static void along_pair(const Model *m, Work *w, int k, int forward, const double *x, double *X) {
  if (!forward) memcpy(w->end + 12 * k, X, 12 * sizeof(double));
  for (int n = m->first[k + 1] - m->first[k], i = 0; i < n; i++) {
    const int f = forward ? m->first[k] + i : m->first[k + 1] - 1 - i;
    if (!forward) passed(m, f, x, -1.0, X);
    memcpy(w->frame + 12 * f, X, 12 * sizeof(double));
    twists_of(m, f, X, w->S);
    if (forward) passed(m, f, x, 1.0, X);
  }
  if (forward) memcpy(w->end + 12 * k, X, 12 * sizeof(double));
}

/* --- states ------------------------------------------------------------------------------------------------------------------------ */

static void quaternion_product(const double *a, const double *b, double *out) {
  out[0] = a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3];
  out[1] = a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2];
  out[2] = a[0] * b[2] + a[2] * b[0] + a[3] * b[1] - a[1] * b[3];
  out[3] = a[0] * b[3] + a[3] * b[0] + a[1] * b[2] - a[2] * b[1];
}

#ifndef MGK_COMPLEX
/* The rotation vector of a unit quaternion, at most a half turn. */
static void quaternion_log(const double *q, double *v) {
  const double sine = sqrt(dot(q + 1, q + 1, 3)), sign = q[0] < 0.0 ? -1.0 : 1.0;
  const double part = sign * (sine < 1e-12 ? 2.0 : 2.0 * atan2(sine, sign * q[0]) / sine);
  FOR(i, 3) v[i] = part * q[1 + i];
}
#endif

/* States after increments dq: x + dq, exp(dq) q. */
static void advance(const Model *m, const double *x, const double *dq, double *out) {
  FOR(f, m->factors) {
    const int s = m->state[f], c = m->column[f];
    if (m->kind[f] < MGK_ROTATION) out[s] = x[s] + dq[c];
    if (m->kind[f] != MGK_ROTATION) continue;
    const double half = 0.5 * sqrt(dot(dq + c, dq + c, 3)), part = fabs(half) > 0.0 ? 0.5 * sin(half) / half : 0.5;
    const double turn[4] = {cos(half), part * dq[c], part * dq[c + 1], part * dq[c + 2]};
    double q[4];
    quaternion_product(turn, x + s, q);
    const double size = sqrt(dot(q, q, 4));
    FOR(i, 4) out[s + i] = q[i] / size;
  }
}

#ifndef MGK_COMPLEX
/* Increments dq from x0 to x1. */
static void difference(const Model *m, const double *x1, const double *x0, double *dq) {
  FOR(f, m->factors) {
    const int s = m->state[f], c = m->column[f];
    if (m->kind[f] < MGK_ROTATION) dq[c] = x1[s] - x0[s];
    if (m->kind[f] != MGK_ROTATION) continue;
    const double back[4] = {x0[s], -x0[s + 1], -x0[s + 2], -x0[s + 3]};
    double q[4];
    quaternion_product(x1 + s, back, q);
    quaternion_log(q, dq + c);
  }
}

/* Rates of increments dq (below a turn) at the state that they lead to: v' = dexp^-1(v) w for rotations; unless `bend` is NULL, which holds
 * accelerations (w' for rotations), those of the increments in place of them. */
static void tangent(const Model *m, const double *dq, const double *rate, double *out, double *bend) {
  memcpy(out, rate, m->columns * sizeof(double));
  FOR(f, m->factors) {
    if (m->kind[f] != MGK_ROTATION) continue;
    const double *v = dq + m->column[f], *w = rate + m->column[f], square = dot(v, v, 3), half = 0.5 * sqrt(square);
    double *r = out + m->column[f], once[3], twice[3];
    const double part = half < 0.05 ? 1.0 / 12 + square * (1.0 / 720 + square * (1.0 / 30240 + square / 1209600)) : (1.0 - half / tan(half)) / square;
    cross(v, w, once);
    cross(v, once, twice);
    FOR(i, 3) r[i] += part * twice[i] - 0.5 * once[i];
    if (!bend) continue;
    double *b = bend + m->column[f], turn[3], other[3], third[3];
    const double slope = 2.0 * dot(v, r, 3) * (1.0 / 720 + square * (1.0 / 15120 + square / 403200)); /* of `part`, in time */
    cross(r, w, turn);
    cross(v, b, other);
    FOR(i, 3) b[i] += slope * twice[i] - 0.5 * (turn[i] + other[i]), turn[i] += other[i];
    cross(r, once, other);
    cross(v, turn, third);
    FOR(i, 3) b[i] += part * (other[i] + third[i]);
  }
}

/* Increments from a node to another one, and there h times their rates and half of h^2 times their accelerations. */
static void seen_from(const Model *m, const Node *a, const Node *b, double h, double *y, double *rate, double *bend) {
  difference(m, b->x, a->x, y);
  memcpy(bend, b->bend, m->columns * sizeof(double));
  tangent(m, y, b->rate, rate, bend);
  FOR(i, m->columns) rate[i] *= h, bend[i] *= 0.5 * h * h;
}

/* The curve through two nodes, of degree five; through a third one too, unless it is NULL, of degree eight. */
static void through(const Model *m, Work *w, const Node *a, const Node *b, const Node *third, Curve *out) {
  const int n = m->columns;
  const double h = *b->at - *a->at, r = third ? (*third->at - *a->at) / h : 0.0, e = r - 1.0;
  double *y = w->there, *rate = y + n, *bend = rate + n, *y3 = bend + n, *rate3 = y3 + n, *bend3 = rate3 + n;
  out->x = a->x, out->at = *a->at, out->length = h, out->until = third ? *a->at - REACHED * r * h : INFINITY;
  seen_from(m, a, b, h, y, rate, bend);
  if (third) seen_from(m, a, third, h, y3, rate3, bend3);
  FOR(i, n) {
    double *c = out->coefficient + POWERS * i;
    const double p = h * a->rate[i], q = rate[i], u = 0.5 * h * h * a->bend[i], v = bend[i], d = y[i];
    c[0] = p, c[1] = u, c[2] = 10 * d - 6 * p - 4 * q - 3 * u + v, c[3] = 8 * p - 15 * d + 7 * q + 3 * u - 2 * v, c[4] = 6 * d - 3 * p - 3 * q - u + v;
    c[5] = c[6] = c[7] = 0.0;
    if (!third) continue;
    /* what the third node is off it, over r^3 (r - 1)^3: value, rate and half the acceleration of the quadratic that remains, by Leibniz's rule */
    const double g = 1.0 / (r * r * r * e * e * e), slope = 3.0 / r + 3.0 / e, turn = 3.0 / (r * r) + 9.0 / (r * e) + 3.0 / (e * e);
    const double A = g * (y3[i] - r * (c[0] + r * (c[1] + r * (c[2] + r * (c[3] + r * c[4])))));
    const double B = g * (rate3[i] - (c[0] + r * (2 * c[1] + r * (3 * c[2] + r * (4 * c[3] + r * 5 * c[4]))))) - slope * A;
    const double C = g * (bend3[i] - (c[1] + r * (3 * c[2] + r * (6 * c[3] + r * 10 * c[4])))) - slope * B - turn * A;
    const double k0 = A - r * (B - r * C), k1 = B - 2 * r * C; /* its coefficients, times s^3 (s^3 - 3 s^2 + 3 s - 1) */
    c[2] -= k0, c[3] += 3 * k0 - k1, c[4] += 3 * (k1 - k0) - C, c[5] = k0 + 3 * (C - k1), c[6] = k1 - 3 * C, c[7] = C;
  }
}

/* The state of a curve at a place. */
static void on_curve(const Model *m, Work *w, const Curve *curve, double at, double *x) {
  const double s = (at - curve->at) / curve->length;
  FOR(i, m->columns) {
    const double *c = curve->coefficient + POWERS * i;
    w->increment[i] = s * (c[0] + s * (c[1] + s * (c[2] + s * (c[3] + s * (c[4] + s * (c[5] + s * (c[6] + s * c[7])))))));
  }
  advance(m, curve->x, w->increment, x);
}

#endif

/* --- closure ----------------------------------------------------------------------------------------------------------------------- */

/* Poses, twists and what the loops leave open at a state; the residual of a loop is taken at its chord, third order exact. */
static magnitude evaluate(const Model *m, Work *w, const double *x) {
  w->evaluations++;
  memcpy(w->pose + 12 * m->frame_link, m->frame, 12 * sizeof(double));
  FOR(t, m->pairs - m->loops) {
    const int *step = m->walk + 4 * t, k = step[0];
    double *X = w->pose + 12 * step[3];
    product(w->pose + 12 * step[2], (step[1] ? m->marker_a : m->marker_b) + 12 * k, X);
    along_pair(m, w, k, step[1], x, X);
  }
  magnitude worst = w->closure = 0.0, reach = 1.0;
  FOR(i, m->links) FOR(r, 3) reach = raised(reach, fabs(w->pose[12 * i + 4 * r + 3]));
  w->reach = reach;
  FOR(l, m->loops) {
    const int k = m->chord[l];
    double P[12], Q[12], e[6];
    product(w->pose + 12 * m->ends[2 * k], m->marker_a + 12 * k, P);
    along_pair(m, w, k, 1, x, P);
    product(w->pose + 12 * m->ends[2 * k + 1], m->marker_b + 12 * k, Q);
    FOR(i, 3) e[i] = 0.0;
    FOR(j, 3) {
      const double p[3] = {P[j], P[4 + j], P[8 + j]}, q[3] = {Q[j], Q[4 + j], Q[8 + j]};
      double part[3];
      cross(q, p, part);
      FOR(i, 3) e[i] += 0.5 * part[i];
    }
    FOR(i, 3) {
      w->middle[3 * l + i] = 0.5 * (P[4 * i + 3] + Q[4 * i + 3]);
      e[3 + i] = P[4 * i + 3] - Q[4 * i + 3];
    }
    /* a turn of more than a right angle has a small sine as well */
    const magnitude x_axes = REAL_PART(P[0] * Q[0] + P[4] * Q[4] + P[8] * Q[8]);
    if (x_axes < 0.0 || REAL_PART(P[1] * Q[1] + P[5] * Q[5] + P[9] * Q[9]) < 0.0) e[m->part] = INFINITY;
    memcpy(w->residual + m->height * l, e + m->part, m->height * sizeof(double));
    worst = raised(worst, size_of(e, 6));
    w->closure = raised(w->closure, raised(fabs(sqrt(dot(e, e, 3))), fabs(sqrt(dot(e + 3, e + 3, 3)))));
  }
  FOR(k, m->couplings) {
    double *e = w->residual + m->height * m->loops + k;
    *e = -m->constant[k];
    for (int i = m->term_first[k]; i < m->term_first[k + 1]; i++) *e += m->coefficient[i] * x[m->column_state[m->term_column[i]]];
    worst = raised(worst, fabs(*e)), w->closure = raised(w->closure, fabs(*e));
  }
  memset(w->residual + m->held, 0, m->passives * sizeof(double));
  return worst;
}

/* Columns of the closure matrix from twists of all freedoms about the origin. `motion`: the velocities of the chords where the rate of
 * the matrix is asked for and S are rates, `twist` the twists themselves. */
static void fill(const Model *m, const double *S, const double *middle, const double *twist, const double *motion, double *out) {
  const int u = m->unknowns;
  memset(out, 0, (size_t)m->rows * u * sizeof(double));
  FOR(l, m->loops) for (int i = m->loop_first[l]; i < m->loop_first[l + 1]; i++) {
    const double sign = m->loop_sign[i];
    for (int c = first_column(m, m->loop_pair[i]); c < first_column(m, m->loop_pair[i] + 1); c++) {
      double s[6], more[3], *to = out + m->height * l * u + m->place[c];
      if (m->place[c] < 0) continue;
      twist_about(S + 6 * c, middle + 3 * l, s);
      if (motion) {
        cross(twist + 6 * c, motion + 3 * l, more);
        FOR(r, 3) s[3 + r] += more[r];
      }
      FOR(r, m->height) to[r * u] = sign * s[m->part + r];
    }
  }
  if (motion) return;
  FOR(k, m->couplings) for (int i = m->term_first[k]; i < m->term_first[k + 1]; i++) {
    const int j = m->place[m->term_column[i]];
    if (j >= 0) out[(m->height * m->loops + k) * u + j] = m->coefficient[i];
  }
}

/* The rows behind those of the closure, which keep increments across the passive motions. */
static void add_border(const Model *m, const Work *w, double *out) {
  FOR(i, m->passives) FOR(j, m->unknowns) out[(m->held + i) * m->unknowns + j] = w->border[i * m->columns + m->unknown[j]];
}

/* Elimination in place, with rows chosen by pivots: the independent rows of a redundant loop come first. Whether all columns are independent. */
static int eliminate(const Model *m, Work *w) {
  const int n = m->unknowns, rows = m->rows;
  double *A = w->lu;
  w->factorizations++;
  FOR(r, rows) w->row[r] = r;
  FOR(i, n) {
    int best = i;
    for (int r = i + 1; r < rows; r++) if (fabs(A[r * n + i]) > fabs(A[best * n + i])) best = r;
    if (best != i) {
      const int row = w->row[i];
      w->row[i] = w->row[best], w->row[best] = row;
      FOR(c, n) { const double t = A[i * n + c]; A[i * n + c] = A[best * n + c], A[best * n + c] = t; }
    }
    if (!(fabs(A[i * n + i]) > 1e-12)) return 0;
    const double d = A[i * n + i] = 1.0 / A[i * n + i];
    for (int r = i + 1; r < rows; r++) {
      double *row = A + r * n;
      if (row[i] == 0.0) continue;
      const double f = row[i] *= d;
      for (int c = i + 1; c < n; c++) row[c] -= f * A[i * n + c];
    }
  }
  return 1;
}

/* Unknowns from the right sides of all rows, by the independent ones; what they leave of the others. */
static magnitude solve(const Model *m, const Work *w, const double *right, double *restrict out) {
  const int n = m->unknowns;
  const double *A = w->lu;
  magnitude left = 0.0;
  FOR(i, n) out[i] = right[w->row[i]];
  FOR(i, n) for (int r = i + 1; r < n; r++) out[r] -= A[r * n + i] * out[i];
  for (int r = n; r < m->rows; r++) left = raised(left, fabs(right[w->row[r]] - dot(A + r * n, out, n)));
  for (int i = n - 1; i >= 0; i--) {
    out[i] *= A[i * n + i];
    FOR(r, i) out[r] -= A[r * n + i] * out[i];
  }
  return left;
}

/* y L = right over the independent rows, in place, given U already: the second half of a transposed solution. */
static void back_through(const Model *m, const Work *w, double *y) {
  const int n = m->unknowns;
  for (int i = n - 2; i >= 0; i--) for (int r = i + 1; r < n; r++) y[i] -= w->lu[r * n + i] * y[r];
}

/* Multipliers of all rows (dropped ones zero) with A^T x = right; `right` is used up. */
static void solve_transposed(const Model *m, const Work *w, double *right, double *out) {
  const int n = m->unknowns;
  FOR(i, n) {
    FOR(c, i) right[i] -= w->lu[c * n + i] * right[c];
    right[i] *= w->lu[i * n + i];
  }
  back_through(m, w, right);
  FOR(r, m->rows) out[w->row[r]] = r < n ? right[r] : 0.0;
}

/* J q' of all rows, or with `pairs` the sums of twists of pairs along the loops. */
static void row_sums(const Model *m, Work *w, const double *dq, const double *pairs, double *out) {
  if (dq) {
    memset(w->pair_twist, 0, (size_t)6 * m->pairs * sizeof(double));
    FOR(c, m->columns) if (dq[c] != 0.0) add_part(6, dq[c], w->S + 6 * c, w->pair_twist + 6 * m->owner[c]);
    pairs = w->pair_twist;
  }
  FOR(l, m->loops) {
    double sum[6] = {0}, about[6];
    for (int i = m->loop_first[l]; i < m->loop_first[l + 1]; i++) add_part(6, m->loop_sign[i], pairs + 6 * m->loop_pair[i], sum);
    twist_about(sum, w->middle + 3 * l, about);
    memcpy(out + m->height * l, about + m->part, m->height * sizeof(double));
  }
  FOR(k, m->couplings) {
    double *sum = out + m->height * m->loops + k;
    *sum = 0.0;
    if (dq) for (int i = m->term_first[k]; i < m->term_first[k + 1]; i++) *sum += m->coefficient[i] * dq[m->term_column[i]];
  }
  memset(out + m->held, 0, m->passives * sizeof(double));
}

/* Rates of all freedoms with J q' + known = 0 for given ones of the drives; what is left of that, relative. */
static magnitude completed(const Model *m, Work *w, const double *driven, const double *known, magnitude size, double *dq) {
  double *right = w->row_value, *found = w->column_value;
  memset(dq, 0, m->columns * sizeof(double));
  FOR(i, m->drives) dq[m->drive[i]] = driven[i];
  row_sums(m, w, dq, NULL, right);
  FOR(r, m->rows) right[r] = -right[r] - (known ? known[r] : 0.0);
  const magnitude left = solve(m, w, right, found);
  FOR(j, m->unknowns) dq[m->unknown[j]] = found[j];
  size += size_of(dq, m->columns) + (known ? size_of(known, m->rows) : 0.0);
  return size > 0.0 ? left / size : 0.0;
}

#ifndef MGK_COMPLEX
/* Closed by Newton from x up to `enough`, in place: evaluated and factored there afterwards, the matrix kept where there is a place for it.
 * w->corrected: by how much. */
static int closed(const Model *m, Work *w, double *x, double *matrix, double enough) {
  double before = INFINITY, sum = 0.0, step = INFINITY;
  FOR(i, ITERATIONS) {
    const double left = evaluate(m, w, x);
    if (!(left < 1.0)) return MGK_STEP;
    const int done = left <= enough * w->reach || (left >= 0.5 * before && left <= ACCEPTED * w->reach);
    if (done || !(step < REUSED)) {
      fill(m, w->S, w->middle, NULL, NULL, w->lu);
      add_border(m, w, w->lu);
      if (matrix) memcpy(matrix, w->lu, (size_t)m->rows * m->unknowns * sizeof(double));
      if (!eliminate(m, w)) return MGK_SINGULAR;
    }
    w->corrected = sum;
    if (done) return MGK_OK;
    double *right = w->row_value, *found = w->column_value;
    FOR(r, m->rows) right[r] = -w->residual[r];
    solve(m, w, right, found);
    step = size_of(found, m->unknowns), sum += step, before = left;
    if (!(sum <= CORRECTION)) return MGK_STEP;
    memset(w->increment, 0, m->columns * sizeof(double));
    FOR(j, m->unknowns) w->increment[m->unknown[j]] = found[j];
    advance(m, x, w->increment, x);
  }
  return MGK_NOT_CLOSED;
}
#endif

/* --- rates ------------------------------------------------------------------------------------------------------------------------- */

/* Twists of all links for rates dq; the velocity part of the relative acceleration of every pair; G: the rate of every twist. */
static void move(const Model *m, Work *w, const double *dq, double *G) {
  memset(w->V + 6 * m->frame_link, 0, 6 * sizeof(double));
  FOR(t, m->pairs) {
    const int chord = t >= m->pairs - m->loops, *step = m->walk + 4 * t;
    const int k = chord ? m->chord[t - m->pairs + m->loops] : step[0], forward = chord || step[1];
    double V[6], *bias = w->bias + 6 * k;
    memcpy(V, w->V + 6 * (chord ? m->ends[2 * k] : step[2]), sizeof V);
    memset(bias, 0, sizeof V);
    for (int n = m->first[k + 1] - m->first[k], i = 0; i < n; i++) {
      const int f = forward ? m->first[k] + i : m->first[k + 1] - 1 - i;
      double s[6] = {0}, part[6];
      for (int c = m->column[f]; c < m->column[f + 1]; c++) add_part(6, dq[c], w->S + 6 * c, s);
      if (!forward) FOR(r, 6) V[r] -= s[r];
      moved_twist(V, s, part);
      FOR(r, 6) bias[r] += part[r];
      if (G) for (int c = m->column[f]; c < m->column[f + 1]; c++) moved_twist(V, w->S + 6 * c, G + 6 * c);
      if (forward) FOR(r, 6) V[r] += s[r];
    }
    memcpy(chord ? w->chord_V + 6 * (t - m->pairs + m->loops) : w->V + 6 * step[3], V, sizeof V);
  }
}

/* Twists dV/dt of all links for accelerations of the freedoms, with the velocity parts of `move`. */
static void accelerate(const Model *m, Work *w, const double *ddq) {
  memset(w->A + 6 * m->frame_link, 0, 6 * sizeof(double));
  FOR(t, m->pairs - m->loops) {
    const int *step = m->walk + 4 * t, k = step[0];
    const double sense = step[1] ? 1.0 : -1.0;
    double sum[6];
    memcpy(sum, w->bias + 6 * k, sizeof sum);
    for (int c = first_column(m, k); c < first_column(m, k + 1); c++) add_part(6, ddq[c], w->S + 6 * c, sum);
    FOR(i, 6) w->A[6 * step[3] + i] = w->A[6 * step[2] + i] + sense * sum[i];
  }
}

/* The first n of `wide` columns reduced to those of the identity, in place: Gauss and Jordan; what stands behind them is solved for.
 * Whether they are independent: the sign of their determinant, or 0. */
static int reduced(double *U, int n, int wide) {
  int sign = 1;
  FOR(i, n) {
    int best = i;
    for (int r = i + 1; r < n; r++) if (fabs(U[wide * r + i]) > fabs(U[wide * best + i])) best = r;
    if (!(fabs(U[wide * best + i]) > 1e-12)) return 0;
    FOR(j, wide) { const double t = U[wide * i + j]; U[wide * i + j] = U[wide * best + j], U[wide * best + j] = t; }
    const double d = 1.0 / U[wide * i + i];
    if ((best != i) != (REAL_PART(d) < 0.0)) sign = -sign;
    for (int j = i; j < wide; j++) U[wide * i + j] *= d;
    FOR(r, n) if (r != i) {
      const double g = U[wide * r + i];
      if (g != 0.0) for (int j = i; j < wide; j++) U[wide * r + j] -= g * U[wide * i + j];
    }
  }
  return sign;
}

/* The inverse of n columns beside them. Whether there is one. */
static int inverted(double *U, int n) {
  FOR(i, n) FOR(j, n) U[2 * n * i + n + j] = i == j;
  return reduced(U, n, 2 * n);
}

/* --- passive motions: what they are and which rates are at rest in them, see kinematics/rates.py ------------------------------ */

/* The first link of a passive motion. */
static int first_of(const Model *m, int i) { return m->passive_link[m->passive_first[i]]; }

/* The axis of a turn, the direction of a slide, in a twist. */
static double *along_axis(const Model *m, double *twists, int i) { return twists + 6 * i + (m->turns[i] ? 0 : 3); }

/* Passive motions at a state just factored, of unit rates along their axes and in the sense of the border; each moves links of its own,
 * by the twists of which they are told apart. */
static int passive_motions(const Model *m, Work *w) {
  const int n = m->passives, c = m->columns;
  double *mixed = w->raw + 6 * n * n;
  FOR(j, n) {
    double *rate = w->passive + j * c;
    memset(w->row_value, 0, m->rows * sizeof(double));
    w->row_value[m->held + j] = 1.0;
    solve(m, w, w->row_value, w->column_value);
    memset(rate, 0, c * sizeof(double));
    FOR(u, m->unknowns) rate[m->unknown[u]] = w->column_value[u];
    move(m, w, rate, NULL);
    FOR(i, n) memcpy(w->raw + 6 * (i * n + j), w->V + 6 * first_of(m, i), 6 * sizeof(double));
  }
  FOR(i, n) {
    const double *of_link = w->raw + 6 * i * n;
    int largest = 0;
    FOR(j, n) if (size_of(of_link + 6 * j, 6) > size_of(of_link + 6 * largest, 6)) largest = j;
    FOR(j, n) w->apart[2 * n * i + j] = dot(of_link + 6 * j, of_link + 6 * largest, 6);
  }
  if (!inverted(w->apart, n)) return MGK_NOT_PASSIVE;
  FOR(a, c) {
    FOR(i, n) {
      mixed[i] = 0.0;
      FOR(j, n) mixed[i] += w->passive[j * c + a] * w->apart[2 * n * j + n + i];
    }
    FOR(i, n) w->passive[i * c + a] = mixed[i];
  }
  FOR(i, n) {
    double *rate = w->passive + i * c, *twist = w->twist + 6 * i;
    move(m, w, rate, NULL);
    memcpy(twist, w->V + 6 * first_of(m, i), 6 * sizeof(double));
    for (int l = m->passive_first[i]; l < m->passive_first[i + 1]; l++) FOR(r, 6) w->V[6 * m->passive_link[l] + r] -= twist[r];
    if (!(size_of(w->V, 6 * m->links) <= STILL * size_of(twist, 6))) return MGK_NOT_PASSIVE;
    const double *axis = along_axis(m, w->twist, i), length = sqrt(dot(axis, axis, 3));
    const double scale = REAL_PART(dot(rate, w->border + i * c, c)) < 0.0 ? -1.0 / length : 1.0 / length;
    FOR(a, c) rate[a] *= scale;
    FOR(r, 6) twist[r] *= scale;
    FOR(r, 6 * m->pairs) w->own_bias[6 * m->pairs * i + r] = scale * scale * w->bias[r];
  }
  return MGK_OK;
}

/* The point of a link whose velocity counts: for a turn the foot on its axis from the origin of the link, for a slide that origin. */
static void rest_point(const Model *m, const Work *w, int i, int link, double *origin, double *foot) {
  const double *base = m->base + 12 * link, own[3] = {base[3], base[7], base[11]}, *U = w->twist + 6 * i;
  double at[6];
  point_of(w->pose + 12 * link, own, origin);
  twist_about(U, origin, at);
  FOR(r, 3) foot[r] = 0.0;
  if (m->turns[i]) cross(U, at + 3, foot);
}

/* Rates without their parts along the passive motions, for which all links move as V. */
static void put_at_rest(const Model *m, const Work *w, double *dq) {
  FOR(i, m->passives) {
    double power = 0.0, square = 0.0;
    for (int l = m->passive_first[i]; l < m->passive_first[i + 1]; l++) {
      const int link = m->passive_link[l];
      double point[3], foot[3], own[6], moving[6];
      rest_point(m, w, i, link, point, foot);
      FOR(r, 3) point[r] += foot[r];
      twist_about(w->twist + 6 * i, point, own);
      twist_about(w->V + 6 * link, point, moving);
      power += dot(own, moving, 6), square += dot(own, own, 6);
    }
    FOR(c, m->columns) dq[c] -= power / square * w->passive[i * m->columns + c];
  }
}

/* Rates of the passive twists where the mechanism moves with dq and the velocity parts of `move`, which are used up; `moving`: the
 * twists of their first links. The accelerations of both motions together, without those of each alone, are dU/ds + dV/dt, where
 * dU/ds - dV/dt = ad(V) U. */
static void twist_rates(const Model *m, Work *w, const double *dq) {
  const int c = m->columns, p = 6 * m->pairs;
  memcpy(w->moving_bias, w->bias, p * sizeof(double));
  FOR(i, m->passives) {
    const double *U = w->twist + 6 * i;
    double *V = w->moving + 6 * i, *out = w->twist_rate + 6 * i;
    FOR(a, c) w->trial_rate[a] = dq[a] + w->passive[i * c + a];
    move(m, w, w->trial_rate, NULL);
    FOR(r, 6) V[r] = w->V[6 * first_of(m, i) + r] - U[r];
    FOR(r, p) w->bias[r] -= w->moving_bias[r] + w->own_bias[p * i + r];
    memset(w->still, 0, m->drives * sizeof(double));
    row_sums(m, w, NULL, w->bias, w->residual);
    completed(m, w, w->still, w->residual, 0.0, w->trial_acceleration);
    accelerate(m, w, w->trial_acceleration);
    moved_twist(V, U, out);
    FOR(r, 6) out[r] = 0.5 * (out[r] + w->A[6 * first_of(m, i) + r]);
  }
}

/* Accelerations so that links stay at rest: the rate of the condition in `put_at_rest` vanishes. */
static void keep_at_rest(const Model *m, const Work *w, double *ddq) {
  FOR(i, m->passives) {
    const double *U = w->twist + 6 * i, *dU = w->twist_rate + 6 * i;
    double power = 0.0, square = 0.0;
    for (int l = m->passive_first[i]; l < m->passive_first[i + 1]; l++) {
      const double *V = w->V + 6 * m->passive_link[l], *A = w->A + 6 * m->passive_link[l];
      double point[3], foot[3], own[6], moving[6], change[6], now[6], velocity[3], part[3];
      rest_point(m, w, i, m->passive_link[l], point, foot);
      twist_about(V, point, moving);
      memcpy(velocity, moving + 3, sizeof velocity);
      if (m->turns[i]) { /* of the foot w x v / w^2, v being the passive velocity of the origin */
        double at[6], from[6], turn[3];
        twist_about(U, point, at);
        twist_about(dU, point, from);
        cross(U, moving + 3, part);
        FOR(r, 3) from[3 + r] += part[r];
        cross(dU, at + 3, part);
        cross(U, from + 3, turn);
        const double grown = 2.0 * dot(U, dU, 3), size = dot(U, U, 3);
        FOR(r, 3) velocity[r] += (part[r] + turn[r] - grown * foot[r]) / size;
      }
      FOR(r, 3) point[r] += foot[r];
      twist_about(U, point, own);
      twist_about(V, point, moving);
      twist_about(dU, point, change);
      twist_about(A, point, now);
      cross(U, velocity, part);
      FOR(r, 3) change[3 + r] += part[r];
      cross(V, velocity, part);
      FOR(r, 3) now[3 + r] += part[r];
      power += dot(change, moving, 6) + dot(own, now, 6), square += dot(own, own, 6);
    }
    FOR(c, m->columns) ddq[c] -= power / square * w->passive[i * m->columns + c];
  }
}

/* Rates of all freedoms, passive motions at rest, and what is left of the closure rates; V and the velocity parts of `move` too. */
static int velocities(const Model *m, Work *w, const double *v, double *dq, magnitude *gap) {
  *gap = completed(m, w, v, NULL, 0.0, dq);
  if (m->passives) {
    const int status = passive_motions(m, w);
    if (status) return status;
    move(m, w, dq, NULL);
    put_at_rest(m, w, dq);
  }
  move(m, w, dq, NULL);
  return MGK_OK;
}

/* Rates and accelerations of all freedoms, twists of all links and their rates. */
static int rates(const Model *m, Work *w, const double *v, const double *a) {
  magnitude turning = 0.0, gap;
  const int status = velocities(m, w, v, w->dq, &gap);
  if (status) return status;
  if (m->passives) {
    twist_rates(m, w, w->dq);
    move(m, w, w->dq, NULL);
  }
  FOR(c, m->columns) turning = raised(turning, fabs(w->dq[c]) * fabs(w->dq[c]));
  double *known = w->residual; /* closed: no longer asked for */
  row_sums(m, w, NULL, w->bias, known);
  gap = raised(gap, completed(m, w, a, known, turning, w->ddq));
  if (gap > INDEPENDENT) return MGK_CONTRADICTION;
  accelerate(m, w, w->ddq);
  if (m->passives) {
    keep_at_rest(m, w, w->ddq);
    accelerate(m, w, w->ddq);
  }
  return isfinite(size_of(w->A, 6 * m->links) + turning) ? MGK_OK : MGK_NOT_FINITE;
}

/* --- forces ------------------------------------------------------------------------------------------------------------------------ */

/* Effort wrenches of a pair combined to be dual to its freedoms, E (S^T E)^-1. */
static int made_dual(const Model *m, Work *w, int k) {
  const int c = first_column(m, k), n = first_column(m, k + 1) - c;
  double U[72], E[36];
  memcpy(E, w->E + 6 * c, 6 * n * sizeof(double));
  FOR(i, n) FOR(j, n) U[2 * n * i + j] = dot(w->S + 6 * (c + i), E + 6 * j, 6);
  if (!inverted(U, n)) return MGK_SINGULAR;
  FOR(j, n) FOR(i, 6) {
    double sum = 0.0;
    FOR(g, n) sum += E[6 * g + i] * U[2 * n * g + n + j];
    w->E[6 * (c + j) + i] = sum;
  }
  return MGK_OK;
}

/* Effort wrenches of all freedoms. */
static int efforts(const Model *m, Work *w) {
  FOR(c, m->columns) {
    const double *end = w->end + 12 * m->owner[c], *X = m->effort_factor[c] < 0 ? end : w->frame + 12 * m->effort_factor[c];
    const double *at = m->effort_at_b[c] ? end : X, point[3] = {at[3], at[7], at[11]};
    double *E = w->E + 6 * c;
    turned(X, m->effort + 6 * c, E);
    turned(X, m->effort + 6 * c + 3, E + 3);
    wrench_moved(E, point, 1.0);
  }
  FOR(k, m->pairs) if (m->dual[k] && made_dual(m, w, k)) return MGK_SINGULAR;
  return MGK_OK;
}

/* A force at a point, added to the wrench on a link. */
static void pushed(Work *w, int link, const double *force, const double *at) {
  double f[6] = {0, 0, 0, force[0], force[1], force[2]};
  wrench_moved(f, at, 1.0);
  w->single = raised(w->single, size_of(f, 6));
  FOR(i, 6) w->applied[6 * link + i] += f[i];
}

/* The force of a table at a coordinate and rate: its cubic there; not a number beyond ends at which it does not hold. */
static double tabulated(const double *number, double x, double rate) {
  const double at = REAL_PART(number[1]) > 0.5 ? rate : x - number[0], *begin = number + 4;
  const int pieces = (int)(REAL_PART(number[3]) + 0.5);
  const magnitude first = REAL_PART(begin[0]), end = REAL_PART(begin[pieces]), place = REAL_PART(at), rounding = OFF_TABLE * (end - first);
  if (REAL_PART(number[2]) < 0.5 && !(place >= first - rounding && place <= end + rounding)) return NAN;
  int low = 0, high = pieces;
  while (high - low > 1) {
    const int middle = (low + high) / 2;
    if (REAL_PART(begin[middle]) <= place) low = middle;
    else high = middle;
  }
  const double *c = begin + pieces + 1 + 4 * low, d = place < first ? 0.0 : place > end ? begin[pieces] - begin[low] : at - begin[low];
  return ((c[0] * d + c[1]) * d + c[2]) * d + c[3];
}

/* A spring, damper or table between points of two links. */
static void between_points(Work *w, int i, int j, const double *number, int table) {
  double p[3], q[3], d[3], back[3], speed = 0.0, length = 0.0;
  point_of(w->pose + 12 * i, number, p);
  point_of(w->pose + 12 * j, number + 3, q);
  FOR(r, 3) d[r] = q[r] - p[r], length += d[r] * d[r];
  length = sqrt(length);
  FOR(side, 2) {
    const double *V = w->V + 6 * (side ? j : i), *at = side ? q : p;
    double v[3];
    cross(V, at, v);
    FOR(r, 3) speed += (side ? 1.0 : -1.0) * (V[3 + r] + v[r]) * (fabs(length) > 0.0 ? d[r] / length : 0.0);
  }
  const double force = table ? tabulated(number + 6, length, speed) : -number[6] * (length - number[7]) - number[8] * speed;
  FOR(r, 3) d[r] *= force == 0.0 ? 0.0 : force / length, back[r] = -d[r];
  pushed(w, i, back, p);
  pushed(w, j, d, q);
}

/* All loads: wrenches on links, efforts in freedoms. */
static void loads(const Model *m, Work *w, const double *x) {
  memset(w->applied, 0, (size_t)6 * m->links * sizeof(double));
  memset(w->given, 0, m->columns * sizeof(double));
  w->single = 0.0;
  FOR(l, m->loads) {
    const int *load = m->load + 4 * l, i = load[1], j = load[2];
    const double *number = m->load_number + load[3];
    double at[3], force[6];
    if (load[0] == MGK_WEIGHT) {
      FOR(b, m->links) if (m->mass[b] != 0.0) {
        FOR(r, 3) force[r] = m->mass[b] * number[r];
        point_of(w->pose + 12 * b, m->center + 3 * b, at);
        pushed(w, b, force, at);
      }
    } else if (load[0] == MGK_WRENCH) {
      const double *X = w->pose + 12 * i;
      memcpy(force, number, sizeof force);
      if (j) turned(X, number, force), turned(X, number + 3, force + 3);
      point_of(X, number + 6, at);
      pushed(w, i, force, at);
      FOR(r, 3) w->applied[6 * i + r] += force[3 + r];
      w->single = raised(w->single, size_of(force + 3, 3));
    } else if (load[0] == MGK_EFFORT) {
      w->given[i] += number[0];
    } else if (load[0] == MGK_LAW) {
      w->given[i] += -number[0] * (x[m->column_state[i]] - number[1]) - number[2] * w->dq[i];
    } else if (load[0] == MGK_TABLE) {
      w->given[i] += tabulated(number, x[m->column_state[j]], w->dq[j]);
    } else if (load[0] < MGK_CONTACT) {
      between_points(w, i, j, number, load[0] == MGK_TABLE_BETWEEN);
    }
  }
}

/* Inertia wrenches -(I A + V x* I V) about the origin; the inertia turns with the link. */
static void inertia(const Model *m, Work *w) {
  memset(w->inertial + 6 * m->frame_link, 0, 6 * sizeof(double));
  FOR(b, m->links) if (b != m->frame_link) {
    const double *X = w->pose + 12 * b, *V = w->V + 6 * b, *A = w->A + 6 * b, *J = m->inertia + 6 * b;
    double c[3], v[3], a[3], part[3], turn[3], rate[3], h[3], M[3], out[3], *f = w->inertial + 6 * b;
    point_of(X, m->center + 3 * b, c);
    cross(V, c, v);
    FOR(i, 3) v[i] += V[3 + i];
    cross(A, c, a);
    cross(V, v, part);
    FOR(i, 3) f[i] = 0.0, f[3 + i] = -m->mass[b] * (a[i] + A[3 + i] + part[i]);
    wrench_moved(f, c, 1.0);
    turned_back(X, V, turn);
    turned_back(X, A, rate);
    const double I[9] = {J[0], J[3], J[4], J[3], J[1], J[5], J[4], J[5], J[2]};
    FOR(i, 3) h[i] = dot(I + 3 * i, turn, 3), M[i] = dot(I + 3 * i, rate, 3);
    cross(turn, h, part);
    FOR(i, 3) M[i] += part[i];
    turned(X, M, out);
    FOR(i, 3) f[i] -= out[i];
  }
}

/* What keeps passive links at rest against wrenches `on` links and `given` efforts: a couple about the axis of a turn, a force along a slide,
 * which loads no pair of the links and comes from outside (force/passive_hold.py). `terms`: sizes of what adds up to the efforts. */
static void hold(const Model *m, Work *w, const double *on, const double *given, double *wrenches, double *efforts, double *terms) {
  memset(wrenches, 0, (size_t)6 * m->links * sizeof(double));
  FOR(i, m->passives) {
    const double *U = w->twist + 6 * i, *rate = w->passive + i * m->columns;
    double power = dot(given, rate, m->columns), square = 0.0, axis[3];
    magnitude sum = raised(w->single, size_of(given, m->columns));
    FOR(c, m->columns) sum += fabs(given[c] * rate[c]);
    for (int pass = 0; pass < 2; pass++) for (int l = m->passive_first[i]; l < m->passive_first[i + 1]; l++) {
      const int link = m->passive_link[l];
      double point[3], foot[3], own[6], *out = wrenches + 6 * link;
      rest_point(m, w, i, link, point, foot);
      FOR(r, 3) point[r] += foot[r];
      twist_about(U, point, own);
      if (pass == 0) {
        square += dot(own, own, 6);
        FOR(r, 6) {
          const double part = on[6 * link + r] * U[r];
          power += part, sum += fabs(part);
        }
      } else {
        FOR(r, 6) out[r] = -power / square * own[r];
        wrench_moved(out, point, 1.0);
      }
    }
    /* in the sense in which the first component of note of the axis in its link is positive */
    const int link = first_of(m, i);
    double in_frame[3];
    turned_back(w->pose + 12 * link, along_axis(m, w->twist, i), in_frame);
    turned_back(m->base + 12 * link, in_frame, axis);
    int first = 0;
    while (first < 2 && !(fabs(axis[first]) > 0.1 * size_of(axis, 3))) first++;
    efforts[i] = REAL_PART(axis[first]) < 0.0 ? power : -power, terms[i] = sum;
  }
}

/* Pair wrenches of multipliers of the loops: w = C^T x, added. */
static void add_loops(const Model *m, const Work *w, const double *x, double *pairs) {
  FOR(l, m->loops) {
    double f[6] = {0};
    memcpy(f + m->part, x + m->height * l, m->height * sizeof(double));
    wrench_moved(f, w->middle + 3 * l, 1.0);
    for (int i = m->loop_first[l]; i < m->loop_first[l + 1]; i++) add_part(6, m->loop_sign[i], f, pairs + 6 * m->loop_pair[i]);
  }
}

/* Efforts in freedoms of multipliers of the couplings. */
static void couple(const Model *m, const double *multiplier, double *out) {
  memset(out, 0, m->columns * sizeof(double));
  FOR(k, m->couplings) for (int i = m->term_first[k]; i < m->term_first[k + 1]; i++)
    out[m->term_column[i]] += m->coefficient[i] * multiplier[k];
}

/* The wrench on gear b for a unit multiplier of a coupling along a line, on the flank that acts. */
static void along_line_of(const Model *m, const Work *w, int l, double *out) {
  const double *X = w->pose + 12 * m->line[2 * l + 1], *G = m->line_wrench + 12 * l + 6 * w->flank[l], at[3] = {X[3], X[7], X[11]};
  turned(X, G, out);
  turned(X, G + 3, out + 3);
  wrench_moved(out, at, 1.0);
}

/* What couplings along lines take off the wrenches of pairs on their ways for multipliers, times a sign: links touch each other, and pairs do
 * not bear what `couple` would bring them (kinematics/touching.py). */
static void relieve(const Model *m, const Work *w, const double *multiplier, double sign, double *pairs) {
  FOR(l, m->lines) {
    const int k = m->line[2 * l];
    double f[6];
    along_line_of(m, w, l, f);
    for (int s = m->line_first[l]; s < m->line_first[l + 1]; s++) {
      const int pair = m->line_step[2 * s];
      add_part(6, -sign * m->line_step[2 * s + 1] * multiplier[k], f, pairs + 6 * pair);
      for (int i = m->term_first[k]; i < m->term_first[k + 1]; i++) {
        const int c = m->term_column[i];
        if (m->owner[c] == pair) add_part(6, sign * m->coefficient[i] * multiplier[k], w->E + 6 * c, pairs + 6 * pair);
      }
    }
  }
}

/* Flanks of the signs of multipliers; how many are other ones now. */
static int turned_over(const Model *m, Work *w, const double *multiplier) {
  int changed = 0;
  FOR(l, m->lines) {
    const int other = REAL_PART(multiplier[m->line[2 * l]]) < 0.0;
    changed += other != w->flank[l], w->flank[l] = other;
  }
  return changed;
}

static void at_points(const Model *m, const Work *w, double *pairs, double sign) {
  FOR(k, m->pairs) {
    const double *X = w->end + 12 * k, point[3] = {X[3], X[7], X[11]};
    wrench_moved(pairs + 6 * k, point, sign);
  }
}

/* The sum over the spans of a belt that its pretension tells, of multipliers. */
static double tension(const Model *m, int belt, const double *multiplier) {
  double sum = 0.0;
  for (int i = m->belt_first[belt]; i < m->belt_first[belt + 1]; i++) sum += m->belt_part[i] * multiplier[m->belt_coupling[i]];
  return sum;
}

/* States of which the last ones, one a belt with a pretension, that of the first behind all, bring a unit of its own `tension` alone, and the
 * others none: elimination in place. Whether every belt has one. */
static int by_belts(const Model *m, int all, double *stress) {
  FOR(b, m->belts) {
    const int count = m->stresses + m->belts - b;
    double *own = stress + (size_t)all * (count - 1);
    magnitude size = 0.0;
    int best = 0;
#define MULTIPLIERS(s) (stress + (size_t)all * (s) + all - m->couplings)
    FOR(s, count) if (fabs(tension(m, b, MULTIPLIERS(s))) > fabs(tension(m, b, MULTIPLIERS(best)))) best = s;
    for (int i = m->belt_first[b]; i < m->belt_first[b + 1]; i++) size = raised(size, fabs(m->belt_part[i]));
    if (!(fabs(tension(m, b, MULTIPLIERS(best))) > UNIQUE * size)) return 0;
    const double unit = 1.0 / tension(m, b, MULTIPLIERS(best));
    FOR(i, all) {
      const double t = unit * stress[(size_t)all * best + i];
      stress[(size_t)all * best + i] = own[i], own[i] = t;
    }
    FOR(s, m->stresses + m->belts) if (s != count - 1) add_part(all, -tension(m, b, MULTIPLIERS(s)), own, stress + (size_t)all * s);
#undef MULTIPLIERS
  }
  return 1;
}

/* Self-stresses: one a dropped row, orthonormal in the reactions at the pair points, moments over L; they stay about these points. Each is
 * reactions, efforts in freedoms and multipliers of couplings, one behind the other as in w->reaction, w->tau, w->multiplier. Behind them
 * those that pretensions decide, see `by_belts`. */
static int self_stresses(const Model *m, Work *w) {
  const int n = m->unknowns, p = 6 * m->pairs, c = m->columns, k = m->couplings, all = p + c + k;
  magnitude largest = 0.0;
  const int count = m->stresses + m->belts;
  memset(w->stress, 0, (size_t)count * all * sizeof(double));
  FOR(s, count) {
    double *null = w->row_value, *stress = w->stress + s * all, *effort = stress + p, *y = w->column_value;
    FOR(i, n) y[i] = -w->lu[(n + s) * n + i];
    back_through(m, w, y);
    FOR(r, m->rows) null[w->row[r]] = r < n ? y[r] : r == n + s ? 1.0 : 0.0;
    add_loops(m, w, null, stress);
    FOR(i, m->drives) effort[m->drive[i]] = dot(w->S + 6 * m->drive[i], stress + 6 * m->owner[m->drive[i]], 6);
    FOR(i, m->terms) {
      const int at = m->term_column[i];
      effort[at] = dot(w->S + 6 * at, stress + 6 * m->owner[at], 6);
    }
    FOR(i, c) if (effort[i] != 0.0) add_part(6, -effort[i], w->E + 6 * i, stress + 6 * m->owner[i]);
    FOR(i, k) effort[c + i] = -null[m->height * m->loops + i];
    relieve(m, w, effort + c, 1.0, stress);
    at_points(m, w, stress, -1.0);
  }
  if (!by_belts(m, all, w->stress)) return MGK_STRAIN;
  FOR(s, m->stresses) {
    w->size[s] = sqrt(dot(w->stress + s * all, w->stress + s * all, p));
    largest = raised(largest, fabs(w->size[s]));
  }
  FOR(s, m->stresses) {
    double *stress = w->stress + s * all, size = w->size[s], before;
    do { /* once more where most was taken away: what is left is rounding of it (J. W. Daniel and others, Math. Comp. 30 (1976) 772-795) */
      before = size;
      FOR(t, s) add_part(all, -dot(stress, w->stress + t * all, p), w->stress + t * all, stress);
      if (s) size = sqrt(dot(stress, stress, p));
      if (!(fabs(size) > DRIVERS_ALONE * largest) || !(largest > DRIVERS_ALONE)) return MGK_STRAIN;
    } while (fabs(size) < 0.7 * fabs(before));
    const double unit = 1.0 / size;
    FOR(i, all) stress[i] *= unit;
  }
  return MGK_OK;
}

/* Total wrenches of all pairs, reactions of least norm and efforts, under wrenches `on` links, `given` efforts and a part of the pretension of
 * belts, and what holds passive links. */
static void borne(const Model *m, Work *w, const double *on, const double *given, double pretension, double *record, const int *places) {
  const int p = 6 * m->pairs, c = m->columns, k = m->couplings;
  memcpy(w->carried, on, (size_t)6 * m->links * sizeof(double));
  if (m->passives) {
    hold(m, w, on, given, record + places[MGK_HOLD], record + places[MGK_HOLDS], record + places[MGK_HOLD_TERMS]);
    FOR(i, 6 * m->links) w->carried[i] += record[places[MGK_HOLD] + i];
  }
  memset(w->total, 0, p * sizeof(double));
  for (int t = m->pairs - m->loops - 1; t >= 0; t--) {
    const int *step = m->walk + 4 * t;
    FOR(r, 6) {
      const double through = w->carried[6 * step[3] + r];
      w->total[6 * step[0] + r] = step[1] ? -through : through;
      w->carried[6 * step[2] + r] += through;
    }
  }
  double *right = w->column_value;
  FOR(j, m->unknowns) {
    const int i = m->unknown[j];
    right[j] = given[i] - dot(w->S + 6 * i, w->total + 6 * m->owner[i], 6);
  }
  solve_transposed(m, w, right, w->row_value);
  add_loops(m, w, w->row_value, w->total);
  FOR(i, k) w->multiplier[i] = -w->row_value[m->height * m->loops + i];
  memcpy(w->reaction, w->total, p * sizeof(double));
  FOR(i, c) {
    w->tau[i] = dot(w->S + 6 * i, w->total + 6 * m->owner[i], 6);
    add_part(6, -w->tau[i], w->E + 6 * i, w->reaction + 6 * m->owner[i]);
  }
  relieve(m, w, w->multiplier, 1.0, w->reaction);
  if (m->stresses + m->belts < 1) return;
  at_points(m, w, w->reaction, -1.0);
  FOR(b, m->belts)
    add_part(p + c + k, pretension * m->pretension[b] - tension(m, b, w->multiplier), w->stress + (size_t)(m->stresses + m->belts - 1 - b) * (p + c + k), w->reaction);
  FOR(s, m->stresses) {
    const double *stress = w->stress + s * (p + c + k);
    add_part(p + c + k, -dot(stress, w->reaction, p), stress, w->reaction);
  }
  at_points(m, w, w->reaction, 1.0);
}

/* The same with the self-stresses, the given efforts being w->given, all on the flanks that w->flank says. */
static int borne_here(const Model *m, Work *w, const double *on, double *record, const int *places) {
  if (m->stresses + m->belts > 0 && self_stresses(m, w)) return MGK_STRAIN;
  borne(m, w, on, w->given, 1.0, record, places);
  return MGK_OK;
}

/* The same on the flanks that press. */
static int borne_on_flanks(const Model *m, Work *w, const double *on, double *record, const int *places) {
  int turns = 0;
  memset(w->flank, 0, m->lines * sizeof(int));
  do {
    if (turns++ > MOST_TURNED) return MGK_FLANKS;
    if (borne_here(m, w, on, record, places)) return MGK_STRAIN;
  } while (turned_over(m, w, w->multiplier));
  return MGK_OK;
}

/* What is left of the equilibrium of links and of the power, and the largest terms, as the package measures them. */
static void checks(const Model *m, Work *w, double *balance, double *power, magnitude *largest) {
  double *left = w->carried;
  magnitude wrench = 0.0, term = 0.0, worst = 0.0;
  *power = 0.0;
  FOR(i, 6 * m->links) left[i] = w->applied[i] + w->inertial[i];
  FOR(i, 6 * m->pairs) w->total[i] = w->reaction[i] + (m->rubs ? w->taken[i] : 0.0);
  FOR(c, m->columns) {
    const double own = w->column_value[c], acting = own + w->given[c] + w->coupled[c];
    worst = raised(worst, fabs(dot(w->S + 6 * c, w->reaction + 6 * m->owner[c], 6)));
    const magnitude most = raised(fabs(own), raised(fabs(w->given[c]), fabs(w->coupled[c])));
    if (most == 0.0) continue;
    add_part(6, acting, w->E + 6 * c, w->total + 6 * m->owner[c]);
    *power += w->dq[c] * acting;
    wrench = raised(wrench, most), term = raised(term, fabs(w->dq[c]) * most);
  }
  relieve(m, w, w->multiplier, -1.0, w->total);
  FOR(b, m->links) w->speed[b] = size_of(w->V + 6 * b, 6);
  FOR(k, m->pairs) {
    const int a = m->ends[2 * k], b = m->ends[2 * k + 1];
    const magnitude through = size_of(w->total + 6 * k, 6), speed = raised(w->speed[a], w->speed[b]);
    FOR(r, 6) left[6 * b + r] += w->total[6 * k + r], left[6 * a + r] -= w->total[6 * k + r];
    wrench = raised(wrench, through), term = raised(term, speed * through);
  }
  FOR(b, m->links) {
    const magnitude speed = w->speed[b], on = raised(size_of(w->applied + 6 * b, 6), size_of(w->inertial + 6 * b, 6));
    *power += dot(w->V + 6 * b, w->applied + 6 * b, 6) + dot(w->V + 6 * b, w->inertial + 6 * b, 6);
    wrench = raised(wrench, on), term = raised(term, speed * on);
    if (b != m->frame_link) worst = raised(worst, size_of(left + 6 * b, 6));
  }
  *balance = worst;
  largest[0] = raised(largest[0], wrench), largest[1] = raised(largest[1], term);
}

#ifndef MGK_COMPLEX
static double sum_of_sizes(const double *a, const double *b, int n) {
  double out = 0.0;
  FOR(i, n) out += fabs(a[i]) * b[i];
  return out;
}

/* A bound of the spectral radius of a matrix of the sizes of M (Collatz and Wielandt), independent of the units of rows and columns. */
static double radius(const double *M, int n, double *v) {
  double best = INFINITY, *next = v + n;
  FOR(i, n) v[i] = 1.0;
  FOR(pass, 4) {
    FOR(i, n) next[i] = sum_of_sizes(M + i * n, v, n);
    FOR(i, n) v[i] = next[i] / v[i];
    best = fmin(best, size_of(v, n));
    const double least = raised(1e-300, 1e-3 * size_of(next, n));
    FOR(i, n) v[i] = raised(least, next[i]);
  }
  return n ? best : 0.0;
}
#endif

/* --- friction ---------------------------------------------------------------------------------------------------------------------- */

/* The friction of all places, see force/friction.py: directions from the motion, one unknown normal force a place, V = a + B n + C V of
 * their normal vectors V, n = |V|, by semismooth Newton where it contracts; else nothing is said here. */

static double sense(double x) { return REAL_PART(x) > 0.0 ? 1.0 : REAL_PART(x) < 0.0 ? -1.0 : 0.0; }

/* A vector made a unit one, nothing where it is not longer than `least`; its length. */
static double made_unit(double *v, magnitude least) {
  const double size = sqrt(dot(v, v, 3));
  FOR(i, 3) v[i] = fabs(size) > least ? v[i] / size : 0.0;
  return fabs(size) > 0.0 ? size : 0.0;
}

static double coefficient(const double *number, double speed) {
  const double v = number[MGK_SPEED], part = speed / (fabs(v) > 0.0 ? v : 1.0);
  return number[MGK_MU] + (fabs(v) > 0.0 ? (number[MGK_STATIC] - number[MGK_MU]) * exp(-part * part) : 0.0);
}

/* The wrench about the origin of a force at a point, times a size. */
static void force_at(const double *p, const double *f, double size, double *out) {
  FOR(i, 3) out[3 + i] = size * f[i];
  cross(p, out + 3, out);
}

/* The velocity at which bodies slide at a point that touches, by the twist of one relative to the other. */
static void sliding_at(const double *twist, const double *at, double *out) {
  cross(twist, at, out);
  FOR(i, 3) out[i] += twist[3 + i];
}

/* Relative twist of the links of a place that rubs, of gear b against gear a where it is one of teeth, at rates of all freedoms. */
static void twist_at(const Model *m, const Work *w, const int *load, const double *rate, double *twist) {
  const int teeth = load[0] == MGK_TEETH, begin = teeth ? m->line_first[load[1]] : 0, end = teeth ? m->line_first[load[1] + 1] : 1;
  memset(twist, 0, 6 * sizeof(double));
  for (int s = begin; s < end; s++) {
    const int k = teeth ? m->line_step[2 * s] : load[1], sense = teeth ? m->line_step[2 * s + 1] : 1;
    for (int c = first_column(m, k); c < first_column(m, k + 1); c++) add_part(6, sense * rate[c], w->S + 6 * c, twist);
  }
}

/* Where bodies touch that press on each other along n: behind the radius of b's from the middle of their frame, before a factor or (-1) last. */
static void touching(const Work *w, int pair, int before, const double *n, double radius, double *at) {
  const double *X = before < 0 ? w->end + 12 * pair : w->frame + 12 * before;
  FOR(i, 3) at[i] = X[4 * i + 3] - radius * n[i];
}

/* Size of a friction wrench -f N U on gear b that leaves an efficiency of the power, see force/friction.py; not a number where none does.
 * `push`: the wrench of a unit normal force, `screws` of gears a and b in the frame X of their carrier, `twist` of b against a. */
static double part_lost(const double *push, const double *X, const double *screws, const double *twist, const double *U, double efficiency) {
  const double at[3] = {X[3], X[7], X[11]};
  double of[2], along = 0.0;
  FOR(g, 2) {
    double Z[6], turn[3];
    turned(X, screws + 6 * g, Z);
    turned(X, screws + 6 * g + 3, Z + 3);
    cross(at, Z, turn);
    FOR(i, 3) Z[3 + i] += turn[i];
    const double power = 1.0 / dot(push, Z, 6);
    of[g] = power * dot(U, Z, 6), along += (g ? power : -power) * dot(twist, Z, 6);
  }
  const double way = sense(along), ca = -way * of[0], cb = way * of[1], room = REAL_PART(way) > 0.0 ? cb + efficiency * ca : ca + efficiency * cb;
  if (REAL_PART(room) > 0.0) return (1.0 - efficiency) / room;
  return REAL_PART(room) < 0.0 ? NAN : 0.0;
}

/* Teeth on the flank that acts, in the motion `slip`: what the place reads of the multiplier, and the wrench on gear b for its normal force. */
static void rubs_between(const Model *m, const Work *w, const int *load, double *reads, double *speed, double *D) {
  const double *n = m->load_number + load[3], arm = n[MGK_RADIUS], efficiency = n[MGK_EFFICIENCY];
  const int l = load[1], other = w->flank[l], slides = REAL_PART(n[MGK_SLIDE_OF]) > 0.5;
  const double *X = w->pose + 12 * m->line[2 * l + 1], sign = other ? -1.0 : 1.0, per = n[MGK_PER + other];
  double push[6], at[3], twist[6], u[3], U[6] = {0};
  twist_at(m, w, load, w->slip, twist);
  along_line_of(m, w, l, push);
  FOR(i, 6) push[i] *= sign / per;
  point_of(X, n + MGK_MESHES_AT + 3 * other, at);
  memcpy(u, twist, sizeof u);
  if (slides) sliding_at(twist, at, u);
  *speed = made_unit(u, TURNING * size_of(twist, 6));
  if (slides) force_at(at, u, 1.0, U);
  else memcpy(U, u, sizeof u), *speed = REAL_PART(arm) < 0.0 ? NAN : *speed * arm;
  const double part = fabs(efficiency) > 0.0 ? part_lost(push, X, n + MGK_SCREWS, twist, U, efficiency) : (slides ? 1.0 : arm) * coefficient(n, *speed);
  FOR(i, 6) D[i] = -part * U[i];
  *reads = sign * per;
}

/* A place in the motion `slip`, pressed as `pressing`: rows of what it reads, wrenches on link b for its normal force and for its normal
 * vector; how many rows it has. */
static int rubs_at(const Model *m, Work *w, int t, const int *load) {
  const double *n = m->load_number + load[3];
  if (load[0] == MGK_TEETH) {
    memset(w->exerts + 24 * t, 0, 24 * sizeof(double));
    rubs_between(m, w, load, w->reads + 18 * t, w->sliding + t, w->exerts + 24 * t);
    return 1;
  }
  const int k = load[1], kind = load[0], turn = (int)REAL_PART(n[MGK_TURN_OF]), slide = (int)REAL_PART(n[MGK_SLIDE_OF]);
  const double *press = w->pressing + 6 * k, *A = w->frame + 12 * m->first[k], *X = REAL_PART(n[MGK_AT_B]) > 0.5 ? w->end + 12 * k : A, r = n[MGK_RADIUS];
  double *reads = w->reads + 18 * t, *D = w->exerts + 24 * t, *K = D + 6, *speed = w->sliding + t, twist[6], u[3], v[3], p[3] = {X[3], X[7], X[11]};
  memset(reads, 0, 18 * sizeof(double)), memset(D, 0, 24 * sizeof(double));
  twist_at(m, w, load, w->slip, twist);
  const magnitude rolls = TURNING * size_of(twist, 6);
  if (kind == MGK_CONTACT || kind == MGK_BALL) FOR(i, 3) reads[6 * i + 3 + i] = 1.0;
  if (kind == MGK_BALL) {
    memcpy(u, twist, sizeof u);
    *speed = r * made_unit(u, 0.0);
    const double mu = coefficient(n, *speed), part = REAL_PART(n[MGK_CIRCLE]) > 0.5 ? mu / sqrt(1.0 + mu * mu) : mu;
    FOR(i, 3) D[i] = -part * r * u[i];
    return 3;
  }
  if (kind == MGK_OPENING) {
    touching(w, k, turn, w->S + 6 * slide + 3, r, v);
    sliding_at(twist, v, u);
    *reads = 1.0, *speed = made_unit(u, rolls);
    force_at(v, u, -coefficient(n, *speed), D);
    return 1;
  }
  if (kind == MGK_CONTACT) {
    double c[3], normal[3] = {press[3], press[4], press[5]}, M[3], at[3];
    touching(w, k, slide, normal, 0.0, c);
    cross(c, press + 3, M);
    FOR(i, 3) M[i] = press[i] - M[i];
    const double size = made_unit(normal, 0.0);
    cross(normal, M, v);
    FOR(i, 3) c[i] += fabs(size) > 0.0 ? v[i] / size : 0.0, at[i] = c[i] - r * normal[i];
    sliding_at(twist, at, u);
    *speed = made_unit(u, rolls);
    const double mu = coefficient(n, *speed);
    force_at(c, u, -mu, D);
    FOR(j, 3) { /* -mu r u x e_j */
      const double e[3] = {j == 0, j == 1, j == 2};
      cross(u, e, K + 6 * j);
      FOR(i, 3) K[6 * j + i] *= -mu * r;
    }
    return 3;
  }
  if (kind == MGK_PLANE) {
    const double z[3] = {A[2], A[6], A[10]}, about = dot(twist, z, 3), force = dot(press + 3, z, 3);
    double M[3];
    cross(p, press + 3, M);
    FOR(i, 3) M[i] = press[i] - M[i], reads[3 + i] = z[i];
    cross(z, M, v);
    FOR(i, 3) p[i] += fabs(force) > 0.0 ? v[i] / force : 0.0;
    sliding_at(twist, p, v);
    const double across = dot(v, z, 3);
    FOR(i, 3) v[i] -= across * z[i];
    *speed = sqrt(dot(v, v, 3) + r * r * about * about);
    const double share = fabs(*speed) > rolls ? -coefficient(n, *speed) / *speed : 0.0;
    force_at(p, v, share, D);
    FOR(i, 3) D[i] += r * r * about * share * z[i];
    return 1;
  }
  const double rate = turn < 0 ? 0.0 : w->slip[turn], along = kind == MGK_THREAD || slide < 0 ? n[MGK_PITCH] * rate : w->slip[slide];
  memcpy(u, w->S + 6 * (turn < 0 ? slide : turn) + (turn < 0 ? 3 : 0), sizeof u);
  if (kind == MGK_THREAD || kind == MGK_COLLAR) {
    const double pitch = n[MGK_PITCH], lead = sense(pitch) * pitch / r;
    memcpy(reads + 3, u, sizeof u);
    *speed = (kind == MGK_COLLAR ? r : sqrt(r * r + pitch * pitch)) * sense(rate) * rate;
    double mu = coefficient(n, *speed), mean = mu * r, more = 0.0;
    if (kind == MGK_THREAD) { /* tangents of sums of lead and friction angle */
      mu *= sqrt(1.0 + n[MGK_FLANK] * n[MGK_FLANK] / (1.0 + lead * lead));
      const double up = (lead + mu) / (1.0 - lead * mu) - lead, down = lead - (lead - mu) / (1.0 + lead * mu);
      mean = 0.5 * r * (up + down), more = 0.5 * r * (up - down) * sense(pitch);
    }
    FOR(i, 3) D[i] = -mean * sense(rate) * u[i], K[i] = -more * fabs(sense(rate)) * u[i];
    return 1;
  }
  *speed = sqrt(r * r * rate * rate + along * along);
  const double mu = coefficient(n, *speed), per = fabs(*speed) > 0.0 ? 1.0 / *speed : 0.0, turns = r * rate * per;
  if (kind == MGK_COUPLE) { /* two forces at the width bear the moment about the axis */
    const double part = 2.0 / (n[MGK_WIDTH] * sense(n[MGK_WIDTH]));
    cross(p, u, v);
    FOR(i, 3) reads[i] = part * u[i], reads[3 + i] = part * v[i];
    force_at(p, u, -mu * sense(along), D);
    return 1;
  }
  const double size = REAL_PART(n[MGK_CIRCLE]) > 0.5 ? mu / sqrt(1.0 + mu * mu * turns * turns) : mu, side = n[MGK_SIDE], far = dot(u, p, 3);
  force_at(p, u, -size * along * per, D);
  FOR(i, 3) D[i] -= size * r * turns * u[i];
  FOR(j, 3) {
    const double e[3] = {j == 0, j == 1, j == 2};
    cross(u, e, v);
    FOR(i, 3) {
      const double across = e[i] - u[i] * u[j];
      K[6 * j + i] = 0.5 * n[MGK_WIDTH] * size * along * per * v[i];
      reads[6 * i + j] = -side * v[i];
      reads[6 * i + 3 + j] = side == 0.0 ? across : 0.5 * across + side * (p[i] * u[j] - far * e[i]);
    }
  }
  return 3;
}

/* Where in an answer a place reads, and how many numbers there a row of w->reads takes: the reaction of its pair, of teeth a multiplier, of
 * what opens the effort in the freedom in which it does. */
static int read_at(const Model *m, const int *load, int *width) {
  *width = load[0] < MGK_OPENING ? 6 : 1;
  if (load[0] == MGK_TEETH) return 6 * m->pairs + m->columns + m->line[2 * load[1]];
  return load[0] == MGK_OPENING ? 6 * m->pairs + (int)REAL_PART(m->load_number[load[3] + MGK_SLIDE_OF]) : 6 * load[1];
}

/* Pairs that the friction of every place would pass, with their senses: its own, of teeth those on the way. */
static void parts_of(const Model *m, Work *w, const int *rubs) {
  const int R = m->rubs;
  int *first = w->row_of + R + 1, *part = w->part_of, count = 0;
  FOR(t, R) {
    const int *load = m->load + 4 * rubs[t], teeth = load[0] == MGK_TEETH, begin = teeth ? m->line_first[load[1]] : 0;
    first[t] = count;
    for (int s = begin; s < (teeth ? m->line_first[load[1] + 1] : 1); s++, count++) {
      part[2 * count] = teeth ? m->line_step[2 * s] : load[1], part[2 * count + 1] = teeth ? m->line_step[2 * s + 1] : 1;
    }
  }
  first[R] = count;
}

/* Answers to a unit effort in every freedom that friction would pass, beside wrenches on the links: of freedom i from on + i apart. */
static void unit_answers(const Model *m, Work *w, const double *on, size_t apart, double *record, const int *places) {
  const int c = m->columns, all = 6 * m->pairs + c + m->couplings, *first = w->row_of + m->rubs + 1;
  memset(w->answered, 0, m->pairs * sizeof(int));
  FOR(p, first[m->rubs]) {
    const int k = w->part_of[2 * p];
    for (int i = first_column(m, k); i < first_column(m, k + 1) && !w->answered[k]; i++) {
      memset(w->rubbed, 0, c * sizeof(double));
      w->rubbed[i] = 1.0;
      borne(m, w, on + apart * i, w->rubbed, 0.0, record, places);
      memcpy(w->unit + (size_t)all * i, w->reaction, all * sizeof(double));
    }
    w->answered[k] = 1;
  }
}

/* The equations of the normal vectors of all places, V = a + B n and what of them C V, solved for V = base + per n: rows of w->linear. What
 * may open presses one way alone, n = V: no solution where it has passed infinity while friction grew. */
static int normal_vectors(const Model *m, Work *w, const int *rubs) {
  int opens = 0;
  const int R = m->rubs, rows = w->row_of[R], wide = rows + 1 + R, all = 6 * m->pairs + m->columns + m->couplings, *first = w->row_of + R + 1;
  FOR(t, R) for (int p = first[t]; p < first[t + 1]; p++) { /* efforts in a pair, and what it takes up */
    const int k = w->part_of[2 * p], c = first_column(m, k), n = first_column(m, k + 1) - c;
    FOR(j, 4) {
      double *own = w->own + 24 * p + 6 * j, *takes = w->takes + 24 * p + 6 * j;
      FOR(i, 6) takes[i] = w->part_of[2 * p + 1] * w->exerts[24 * t + 6 * j + i];
      FOR(f, n) own[f] = dot(w->S + 6 * (c + f), takes, 6);
      FOR(f, n) add_part(6, -own[f], w->E + 6 * (c + f), takes);
    }
  }
  FOR(t, R) for (int r = w->row_of[t]; r < w->row_of[t + 1]; r++) {
    int width;
    const int at = read_at(m, m->load + 4 * rubs[t], &width);
    const double *reads = w->reads + 18 * t + 6 * (r - w->row_of[t]);
    double *row = w->linear + (size_t)wide * r, *base = row + rows;
    *base = dot(reads, w->smooth + at, width);
    FOR(i, rows) row[i] = i == r;
    FOR(o, R) FOR(j, 1 + w->row_of[o + 1] - w->row_of[o]) {
      double sum = 0.0;
      for (int p = first[o]; p < first[o + 1]; p++) {
        const int k = w->part_of[2 * p], c = first_column(m, k), n = first_column(m, k + 1) - c;
        const double *own = w->own + 24 * p + 6 * j;
        if (6 * k == at && width == 6) sum -= dot(reads, w->takes + 24 * p + 6 * j, 6);
        FOR(f, n) if (own[f] != 0.0) sum += own[f] * dot(reads, w->unit + (size_t)all * (c + f) + at, width);
      }
      const int one_way = m->load[4 * rubs[o]] == MGK_OPENING;
      if (j) row[w->row_of[o] + j - 1] -= sum;
      else {
        *base += sum * m->load_number[m->load[4 * rubs[o] + 3] + MGK_PRELOAD], base[1 + o] = one_way ? 0.0 : sum;
        if (one_way) row[w->row_of[o]] -= sum, opens = 1;
      }
    }
  }
  const int sign = reduced(w->linear, rows, wide);
  return opens ? sign > 0 : sign != 0;
}

/* Normal forces n = |base + per n|, or V of what opens, by semismooth Newton, and their vectors; whether they are found and, being a
 * contraction, the only ones. */
static int normal_forces(const Model *m, Work *w, const int *rubs) {
  const int R = m->rubs, rows = w->row_of[R], wide = rows + 1 + R;
  double *n = w->normal, *V = w->vector;
  magnitude scale = 0.0;
  FOR(t, R) FOR(o, R + 1) {
    double square = 0.0;
    for (int r = w->row_of[t]; r < w->row_of[t + 1]; r++) square += w->linear[(size_t)wide * r + rows + o] * w->linear[(size_t)wide * r + rows + o];
    if (o) w->sized[R * t + o - 1] = sqrt(square);
    else n[t] = sqrt(square), scale = raised(scale, fabs(n[t]));
  }
#ifndef MGK_COMPLEX
  if (!(radius(w->sized, R, w->vector + rows) < 1.0)) return 0;
#endif
  for (int pass = 0, done = 0; pass < MOST_NEWTON; pass++) {
    magnitude most = 0.0, size = scale;
    FOR(r, rows) {
      const double *row = w->linear + (size_t)wide * r + rows;
      V[r] = row[0] + dot(row + 1, n, R);
    }
    if (done) return 1;
    FOR(t, R) {
      const int first = w->row_of[t], rank = w->row_of[t + 1] - first;
      const double length = m->load[4 * rubs[t]] == MGK_OPENING ? V[first] : rank == 1 ? sense(V[first]) * V[first] : sqrt(dot(V + first, V + first, rank));
      double *row = w->slope + (R + 1) * t;
      FOR(o, R) {
        row[o] = o == t;
        if (fabs(length) > 0.0) FOR(j, rank) row[o] -= V[first + j] / length * w->linear[(size_t)wide * (first + j) + rows + 1 + o];
      }
      row[R] = n[t] - length;
      most = raised(most, fabs(row[R])), size = raised(size, fabs(length));
    }
    done = most <= NEWTON_DONE * size; /* once more: what is a derivative follows a step behind */
    if (!reduced(w->slope, R, R + 1)) return 0;
    FOR(t, R) n[t] -= w->slope[(R + 1) * t + R];
  }
  return 0;
}

/* By how much a self-stress, about the point of the pair, is along the reaction `force` about the origin in what place t reads of it: the sum
 * over the components, which stand in the marker on a. */
static double along_components(const Model *m, const Work *w, int t, int pair, double *stress, const double *force) {
  const double *X = w->end + 12 * pair, *A = w->frame + 12 * m->first[pair], point[3] = {X[3], X[7], X[11]}, a[3] = {A[3], A[7], A[11]};
  double own[6], acting[6], sum = 0.0;
  wrench_moved(stress, point, 1.0);
  memcpy(own, stress, sizeof own), memcpy(acting, force, sizeof acting);
  wrench_moved(own, a, -1.0), wrench_moved(acting, a, -1.0);
  FOR(j, 6) {
    const double e[3] = {A[j % 3], A[4 + j % 3], A[8 + j % 3]};
    double weight = 0.0, arm[3];
    for (int r = 0; r < w->row_of[t + 1] - w->row_of[t]; r++) {
      const double *row = w->reads + 18 * t + 6 * r;
      cross(row, a, arm);
      const double part = j < 3 ? dot(row, e, 3) : dot(row + 3, e, 3) + dot(arm, e, 3);
      weight += part * part;
    }
    sum += weight * dot(own + 3 * (j / 3), e, 3) * dot(acting + 3 * (j / 3), e, 3);
  }
  return sum;
}

/* Whether something rubs under components that a self-stress may change and to which loads add: those that are zero along it stay so. */
static int loosened(const Model *m, const Work *w, const int *rubs) {
  const magnitude largest = size_of(w->smooth, 6 * m->pairs);
  FOR(t, m->rubs) FOR(s, m->stresses) {
    int width;
    const int at = read_at(m, m->load + 4 * rubs[t], &width);
    const double *force = w->pressing + at;
    double stress[6], along = 0.0, square = 0.0;
    if (!(size_of(w->exerts + 24 * t, 24) > 0.0)) continue;
    memcpy(stress, w->stress + s * (6 * m->pairs + m->columns + m->couplings) + at, width * sizeof(double));
    if (width == 6) along = along_components(m, w, t, at / 6, stress, force);
    for (int r = 0; r < w->row_of[t + 1] - w->row_of[t]; r++) {
      const double *row = w->reads + 18 * t + 6 * r, part = dot(row, stress, width);
      square += part * part;
      if (width != 6) along += part * dot(row, force, width);
    }
    const magnitude size = fabs(sqrt(square));
    if (size > UNIQUE && !(fabs(along) <= UNIQUE * size * largest)) return 1;
  }
  return 0;
}

/* Rates that tell where friction acts in a given motion; whether anything moves. */
static int directed(const Model *m, Work *w) {
  const magnitude fastest = size_of(w->dq, m->columns);
  int moves = 0;
  FOR(i, m->columns) {
    const magnitude rate = fabs(w->dq[i]);
    const int rests = rate <= TURNING * fastest || rate <= STILL * sqrt(fabs(w->ddq[i]));
    w->slip[i] = rests ? 0.0 : w->dq[i], moves |= !rests;
  }
  return moves;
}

/* Friction on the flanks that w->flank says, see `friction`; 0 where it has settled. */
static int settled(const Model *m, Work *w, const double *on, size_t apart, const int *rubs, int follows, double *record, const int *places) {
  const int R = m->rubs, c = m->columns, p = 6 * m->pairs, all = p + c + m->couplings, *first = w->row_of + R + 1;
  memcpy(w->smooth, w->reaction, all * sizeof(double)), memcpy(w->pressing, w->reaction, all * sizeof(double));
  unit_answers(m, w, on, apart, record, places);
  FOR(round, follows ? MOST_ROUNDS : 1) {
    magnitude moved = 0.0;
    w->row_of[0] = 0;
    FOR(t, R) w->row_of[t + 1] = w->row_of[t] + rubs_at(m, w, t, m->load + 4 * rubs[t]);
    if (!normal_vectors(m, w, rubs) || !normal_forces(m, w, rubs)) break;
    memset(w->rubbed, 0, c * sizeof(double)), memset(w->taken, 0, p * sizeof(double));
    memset(w->teeth, 0, c * sizeof(double)), memset(w->beside, 0, p * sizeof(double)), memset(w->rubbing, 0, 6 * m->couplings * sizeof(double));
    FOR(t, R) {
      const int *load = m->load + 4 * rubs[t];
      w->normal[t] += m->load_number[load[3] + MGK_PRELOAD];
      for (int q = first[t]; q < first[t + 1]; q++) FOR(j, 1 + w->row_of[t + 1] - w->row_of[t]) {
        const int k = w->part_of[2 * q], at = first_column(m, k), n = first_column(m, k + 1) - at;
        const double size = j ? w->vector[w->row_of[t] + j - 1] : w->normal[t];
        add_part(n, size, w->own + 24 * q + 6 * j, w->rubbed + at);
        add_part(6, size, w->takes + 24 * q + 6 * j, w->taken + 6 * k);
        if (load[0] != MGK_TEETH) continue;
        add_part(n, size, w->own + 24 * q + 6 * j, w->teeth + at);
        add_part(6, size, w->takes + 24 * q + 6 * j, w->beside + 6 * k);
      }
      if (load[0] == MGK_TEETH) add_part(6, w->normal[t], w->exerts + 24 * t, w->rubbing + 6 * m->line[2 * load[1]]);
    }
    FOR(i, all) {
      double now = w->smooth[i] - (i < p ? w->taken[i] : 0.0);
      FOR(a, c) if (w->rubbed[a] != 0.0) now += w->rubbed[a] * w->unit[(size_t)all * a + i];
      if (i < p) moved = raised(moved, fabs(now - w->pressing[i]));
      w->pressing[i] = now;
    }
    if (!follows || moved <= SETTLED * size_of(w->pressing, p)) return 0;
  }
  return 1;
}

/* Friction beside the reactions without it, which stand in w->reaction, in the directions of w->slip: efforts w->rubbed and what pairs take
 * up w->taken; 0 where that is sure, 1 where it is not. Where it turns the force between teeth round, once more on their other flanks, under
 * the loads `bare`. Links yield to unit efforts by wrenches `on` them, see unit_answers. */
static int friction(const Model *m, Work *w, const double *bare, const double *on, size_t apart, double *record, const int *places) {
  int follows = 0, found = 0, *rubs = w->row_of + 2 * (m->rubs + 1);
  FOR(l, m->loads) if (m->load[4 * l] >= MGK_CONTACT) rubs[found++] = l, follows |= m->load[4 * l] <= MGK_PLANE;
  parts_of(m, w, rubs);
  FOR(turns, MOST_TURNED + 1) {
    if (turns && borne_here(m, w, bare, record, places)) return 1;
    if (settled(m, w, on, apart, rubs, follows, record, places)) return 1;
    if (!turned_over(m, w, w->pressing + 6 * m->pairs + m->columns)) return loosened(m, w, rubs);
  }
  return 1;
}

/* --- all forces -------------------------------------------------------------------------------------------------------------------- */

/* All forces at a state with rates; the force parts of a record. */
static int forces(const Model *m, Work *w, const double *x, double *record, const int *places, magnitude *largest) {
  if (efforts(m, w)) return MGK_SINGULAR;
  loads(m, w, x);
  inertia(m, w);
  FOR(i, 6 * m->links) w->bare[i] = w->applied[i] + w->inertial[i];
  const int status = borne_on_flanks(m, w, w->bare, record, places);
  if (status) return status;
  if (m->rubs) {
    memset(w->nothing, 0, (size_t)6 * m->links * sizeof(double));
    const int unsure = directed(m, w) ? friction(m, w, w->bare, w->nothing, 0, record, places) : 2;
    if (unsure) {
      memset(w->rubbed, 0, m->columns * sizeof(double)), memset(w->taken, 0, (size_t)6 * m->pairs * sizeof(double));
      memset(w->teeth, 0, m->columns * sizeof(double)), memset(w->beside, 0, (size_t)6 * m->pairs * sizeof(double));
      memset(w->rubbing, 0, (size_t)6 * m->couplings * sizeof(double));
    }
    add_part(m->columns, 1.0, w->rubbed, w->given);
    borne(m, w, w->bare, w->given, 1.0, record, places);
    add_part(6 * m->pairs, -1.0, w->taken, w->reaction);
    record[places[MGK_UNSURE]] = unsure;
  }
  couple(m, w->multiplier, w->coupled);
  if (m->rubs) { /* what acts between teeth is no effort given in a freedom */
    add_part(m->columns, -1.0, w->teeth, w->given), add_part(m->columns, 1.0, w->teeth, w->coupled);
  }
  double *own = w->column_value;
  memset(own, 0, m->columns * sizeof(double));
  FOR(i, m->drives) {
    const int c = m->drive[i];
    own[c] = w->tau[c] - w->given[c] - w->coupled[c];
  }
  if (m->passives) FOR(i, 6 * m->links) w->applied[i] += record[places[MGK_HOLD] + i];
  checks(m, w, record + places[MGK_BALANCE], record + places[MGK_POWER], largest);
  double *shaking = record + places[MGK_SHAKING], *body = record + places[MGK_BODY_LOADS];
  memset(shaking, 0, 6 * sizeof(double)); /* what links exert on each other cancels */
  FOR(b, m->links) FOR(r, 6) {
    body[6 * b + r] = w->applied[6 * b + r] + w->inertial[6 * b + r];
    shaking[r] += body[6 * b + r];
  }
  FOR(k, m->pairs) FOR(r, 3) record[places[MGK_POINTS] + 3 * k + r] = w->end[12 * k + 4 * r + 3];
#define PUT(part, values) memcpy(record + places[part], values, (size_t)(places[part + 1] - places[part]) * sizeof(double))
  PUT(MGK_REACTIONS, w->reaction), PUT(MGK_EFFORTS, w->tau), PUT(MGK_GIVEN, w->given), PUT(MGK_COUPLED, w->coupled);
  PUT(MGK_MULTIPLIERS, w->multiplier);
  if (m->rubs) {
    FOR(c, m->columns) record[places[MGK_RUBBED] + c] = w->rubbed[c] - w->teeth[c];
    FOR(i, 6 * m->pairs) record[places[MGK_TAKEN] + i] = w->taken[i] - w->beside[i];
    PUT(MGK_SPEEDS, w->sliding), PUT(MGK_NORMALS, w->normal), PUT(MGK_TEETH_EFFORTS, w->teeth), PUT(MGK_RUBBING, w->rubbing);
  }
  FOR(s, m->stresses) {
    const int p = 6 * m->pairs, c = m->columns, k = m->couplings;
    double *stress = w->stress + s * (p + c + k);
    at_points(m, w, stress, 1.0);
    memcpy(record + places[MGK_STRESS] + s * p, stress, p * sizeof(double));
    memcpy(record + places[MGK_STRESS_EFFORTS] + s * c, stress + p, c * sizeof(double));
    memcpy(record + places[MGK_MULTIPLIER_STRESS] + s * k, stress + p + c, k * sizeof(double));
    couple(m, stress + p + c, record + places[MGK_COUPLED_STRESS] + s * c);
  }
  return isfinite(fabs(record[places[MGK_BALANCE]] + record[places[MGK_POWER]])) ? MGK_OK : MGK_NOT_FINITE;
}

/* A wrench about the global origin in the units of the declaration; NaN where a self-stress has a part. */
static void given_out(const Model *m, const double *record, const int *places, int k, double *out) {
  const double L = *m->unit, *w = record + places[MGK_REACTIONS] + 6 * k;
  double size[6] = {0}, far[3], moved[6];
  FOR(i, 3) far[i] = m->origin[i] / L;
  FOR(s, m->stresses) {
    memcpy(moved, record + places[MGK_STRESS] + 6 * (s * m->pairs + k), sizeof moved);
    wrench_moved(moved, far, 1.0);
    FOR(i, 6) size[i] += moved[i] * moved[i];
  }
  memcpy(moved, w, sizeof moved);
  wrench_moved(moved, far, 1.0);
  const magnitude most = UNIQUE * (1.0 + fabs(sqrt(dot(far, far, 3))));
  FOR(i, 6) out[i] = fabs(sqrt(size[i])) > most ? NAN : moved[i] * (i < 3 ? L * L : L);
}

/* What the drive in a freedom supplies, in the units of the declaration; NaN where a self-stress has a part. */
static double effort_out(const Model *m, const double *record, const int *places, int c) {
  const double L = *m->unit, own = record[places[MGK_EFFORTS] + c] - record[places[MGK_GIVEN] + c] - record[places[MGK_COUPLED] + c];
  double size = 0.0;
  FOR(s, m->stresses) {
    const int at = s * m->columns + c;
    const double strain = record[places[MGK_STRESS_EFFORTS] + at] - record[places[MGK_COUPLED_STRESS] + at];
    size += strain * strain;
  }
  return fabs(sqrt(size)) > UNIQUE ? NAN : own * (m->is_length[c] ? L : L * L);
}

#ifndef MGK_COMPLEX
/* --- paths ------------------------------------------------------------------------------------------------------------------------- */

/* Where rotation vectors of the user stand, continued from the last state: signed angles about axes that do not flip, unwrapped. */
static void coordinates(const Model *m, Work *w, const double *x, double *out) {
  FOR(f, m->factors) {
    const int c = m->column[f], s = m->state[f];
    if (m->kind[f] < MGK_ROTATION) out[c] = x[s] * (m->is_length[c] ? *m->unit : 1.0);
    if (m->kind[f] != MGK_ROTATION) continue;
    double *axis = w->axis + 3 * f, *angle = w->angle + f, v[3];
    quaternion_log(x + s, v);
    const double size = sqrt(dot(v, v, 3));
    const int clear = size > 1e-9;
    memcpy(out + c, v, sizeof v);
    if (clear) {
      const double sign = w->begun[f] != 0.0 && dot(v, axis, 3) < 0.0 ? -1.0 : 1.0;
      FOR(i, 3) axis[i] = sign * v[i] / size;
      if (w->begun[f] == 0.0) *angle = dot(m->start_coordinates + c, axis, 3);
      w->begun[f] = 1.0;
    }
    if (w->begun[f] == 0.0) continue;
    const double about = dot(v, axis, 3), turn = 8.0 * atan(1.0);
    *angle = about + turn * floor((*angle - about) / turn + 0.5);
    if (clear || fabs(*angle) > 1.0) FOR(i, 3) out[c + i] = *angle * axis[i];
  }
}

/* Rotation vectors continued up to a place of the step: near whole turns axes swing round within a part of a step. */
static void continued(const Model *m, Work *w, double at) {
  const double from = w->told, whole = 8.0 * atan(1.0);
  double part = 0.0; /* of the way to a whole turn, over that of the step */
  FOR(f, m->factors) if (m->kind[f] == MGK_ROTATION) {
    const int c = m->column[f];
    const double left = w->angle[f] - whole * floor(w->angle[f] / whole + 0.5);
    part = raised(part, raised(size_of(w->a.rate + c, 3), size_of(w->b.rate + c, 3)) / raised(fabs(left), 1e-9));
  }
  w->told = at;
  if (!(at > from)) return;
  if (part * (at - from) <= UNSWUNG) return;
  const int n = (int)ceil(TOLD * fmin(part * (at - from), (at - from) / (*w->b.at - *w->a.at)));
  for (int i = 1; i < n; i++) {
    on_curve(m, w, &w->arc, from + (at - from) * i / n, w->trial);
    coordinates(m, w, w->trial, w->dq);
  }
}

/* Whether it moves them. */
static int set_drives(const Model *m, double *x, const double *q) {
  int moves = 0;
  FOR(i, m->drives) {
    double *own = x + m->column_state[m->drive[i]];
    moves |= *own != q[i], *own = q[i];
  }
  return moves;
}

/* The inverse of the independent rows of the closure matrix that has just been factored, and its condition. */
static double made_inverse(const Model *m, Work *w, const double *matrix) {
  const int n = m->unknowns;
  double largest = 1.0, inverse = 0.0, *X = w->inverse;
  memset(X, 0, (size_t)n * n * sizeof(double));
  FOR(i, n) {
    const double *A = w->lu + i * n;
    X[i * n + i] = 1.0;
    FOR(c, i) FOR(j, c + 1) X[i * n + j] -= A[c] * X[c * n + j];
  }
  for (int i = n - 1; i >= 0; i--) {
    const double *A = w->lu + i * n;
    for (int c = i + 1; c < n; c++) FOR(j, n) X[i * n + j] -= A[c] * X[c * n + j];
    FOR(j, n) X[i * n + j] *= A[i];
  }
  FOR(i, n) {
    double of_matrix = 0.0, of_inverse = 0.0;
    FOR(j, n) of_matrix += fabs(matrix[w->row[i] * n + j]), of_inverse += fabs(X[i * n + j]);
    largest = raised(largest, of_matrix), inverse = raised(inverse, of_inverse);
  }
  return largest * inverse;
}

/* What a node is beside its closed state, at which it has just been factored: rates along the path, those of the matrix, the condition. */
static int made_node(const Model *m, Work *w, Node *node) {
  const int n = m->unknowns;
  memset(w->still, 0, m->drives * sizeof(double));
  const int status = rates(m, w, w->direction, w->still);
  if (status) return status;
  memcpy(node->rate, w->dq, m->columns * sizeof(double)), memcpy(node->bend, w->ddq, m->columns * sizeof(double));
  memcpy(node->passive, w->passive, (size_t)m->passives * m->columns * sizeof(double));
  memcpy(node->twist, w->twist, (size_t)6 * m->passives * sizeof(double));
  FOR(i, m->passives) memcpy(node->pose + 12 * i, w->pose + 12 * first_of(m, i), 12 * sizeof(double));
  move(m, w, node->rate, w->G);
  FOR(l, m->loops) {
    double *V = w->chord_V + 6 * l, turn[3];
    cross(V, w->middle + 3 * l, turn);
    FOR(i, 3) V[i] = V[3 + i] + turn[i];
    memmove(w->chord_V + 3 * l, V, 3 * sizeof(double));
  }
  fill(m, w->G, w->middle, w->S, w->chord_V, node->matrix_rate);
  node->condition = made_inverse(m, w, node->matrix);
  memcpy(node->inverse, w->inverse, (size_t)n * n * sizeof(double));
  memcpy(node->row, w->row, n * sizeof(int));
  memset(node->change, 0, (size_t)n * n * sizeof(double));
  FOR(i, n) FOR(r, n) FOR(j, n) node->change[i * n + j] += node->inverse[i * n + r] * node->matrix_rate[node->row[r] * n + j];
  node->reach = 1.0 / raised(radius(node->change, n, w->bound), 1e-9);
  return node->condition <= FAIR ? MGK_OK : MGK_SINGULAR;
}

/* How far the closure matrix departs from that of a node on its half of a step of length h to another one (h < 0: behind the other): a bound
 * of the spectral radius of |C^-1 (C - C_i)| for the Bezier points C_i of this half, with what the matrix in the middle is off them. */
static double departed(const Model *m, Work *w, const Node *here, const Node *there, double h) {
  const int n = m->unknowns;
  const double third = h / 3.0;
  double *restrict whole = w->bound, *restrict last = whole + n, *restrict off = last + n;
  FOR(i, n) {
    memset(whole, 0, 3 * (size_t)n * sizeof(double));
    FOR(r, n) {
      const int row = here->row[r] * n;
      const double g = here->inverse[i * n + r], *A = here->matrix + row, *B = there->matrix + row, *far = there->matrix_rate + row;
      FOR(j, n) whole[j] += g * (B[j] - A[j]), last[j] += g * far[j], off[j] += g * w->lu[row + j];
    }
    FOR(j, n) {
      const double near = third * here->change[i * n + j], far = whole[j] - third * last[j];
      w->change[i * n + j] =
          raised(raised(0.5 * fabs(near), 0.25 * fabs(2.0 * near + far)), 0.125 * fabs(3.0 * (near + far) + whole[j])) + fabs(off[j]);
    }
  }
  return radius(w->change, n, w->bound);
}

/* Whether the step from node a to b leads along one regular branch, b being factored; grown: by how much the next one may be longer.
 *
 * The closure matrix along the step is, to fourth order, the Hermite cubic through both ends and what it is off that in the middle; either
 * half of the cubic lies in the hull of its Bezier points C_i: no matrix is singular where |C^-1 (C - C_i)| < 1 for all of them, C being
 * that at its end (Banach's lemma). That b is on the branch of a and not on another one: the states' own polynomial, through the `third`
 * node behind a too, is closed in the middle, where it is furthest from the track, by a correction that is small against the distance of
 * any two solutions, 2 / (|J^-1| |J'|) at least (see maths/tracker.py, where the same limit holds). */
static int certified(const Model *m, Work *w, const Node *third, double *grown) {
  const int n = m->unknowns;
  const Node *a = &w->a, *b = &w->b;
  const double h = *b->at - *a->at;
  through(m, w, a, b, third, &w->arc);
  on_curve(m, w, &w->arc, 0.5 * (*a->at + *b->at), w->trial);
  if (!isfinite(evaluate(m, w, w->trial))) return 0;
  solve(m, w, w->residual, w->column_value);
  fill(m, w->S, w->middle, NULL, NULL, w->lu);
  add_border(m, w, w->lu);
  FOR(i, m->rows * n) w->lu[i] -= 0.5 * (a->matrix[i] + b->matrix[i]) + 0.125 * h * (a->matrix_rate[i] - b->matrix_rate[i]);
  const double departure = raised(departed(m, w, b, a, -h), departed(m, w, a, b, h));
  double size = raised(1.0, raised(size_of(a->rate, m->columns), size_of(b->rate, m->columns)));
  const double correction = 4.0 * size_of(w->column_value, n), allowed = w->allowed = ALONE / (size * raised(1.0, raised(a->condition, b->condition)));
  *grown = raised(0.4, 0.8 * fmin(DEPARTURE / raised(departure, 1e-9), pow(allowed / raised(correction, 1e-300), third ? 1.0 / 9 : 1.0 / 6)));
  return departure <= DEPARTURE && correction <= allowed;
}

/* Rates, forces and the record of a closed state just factored. */
static int put(const Model *m, Work *w, const double *x, const double *v, const double *a, int with_forces, const int *places, double *record,
               double *largest) {
  double *condition = record + places[MGK_CONDITION];
  record[places[MGK_CLOSURE]] = w->closure, condition[0] = raised(w->a.condition, w->b.condition), condition[1] = w->reach;
  const int status = rates(m, w, v, a);
  if (status) return status;
  PUT(MGK_X, x), PUT(MGK_DQ, w->dq), PUT(MGK_DDQ, w->ddq);
  coordinates(m, w, x, record + places[MGK_COORDINATES]);
  return with_forces ? forces(m, w, x, record, places, largest) : MGK_OK;
}

/* --- passive links at rest, see kinematics/passive_rest.py ---------------------------------------------------------------------------- */

/* The border across the passive motions of a node, in its matrix too, so that the next step begins and ends with the same rows. */
static void set_border(const Model *m, Work *w, Node *node) {
  const int c = m->columns;
  FOR(i, m->passives) {
    const double size = size_of(node->passive + i * c, c);
    FOR(a, c) w->border[i * c + a] = node->passive[i * c + a] / size;
  }
  add_border(m, w, node->matrix);
}

/* The part of e across a unit vector u, of unit length; its length. */
static double across(const double *e, const double *u, double *out) {
  const double part = dot(e, u, 3);
  FOR(i, 3) out[i] = e[i] - part * u[i];
  const double length = sqrt(dot(out, out, 3));
  FOR(i, 3) out[i] /= length;
  return length;
}

/* Rate at which the part of e across u turns about it where u changes by du: n' . (u x n). */
static double turning(const double *e, const double *u, const double *du) {
  double n[3], turn[3];
  const double length = across(e, u, n);
  cross(u, n, turn);
  return -dot(e, u, 3) * dot(du, turn, 3) / length;
}

/* What the amount of a turn is counted from over a step: a reference in space and one in the link, both across the axis at node a. */
static void references(const Model *m, const Work *w, int i, double *in_space, double *in_link) {
  const double *u = along_axis(m, w->a.twist, i);
  double e[3] = {0};
  int least = 0;
  FOR(r, 3) if (fabs(u[r]) < fabs(u[least])) least = r;
  e[least] = 1.0;
  across(e, u, in_space);
  turned_back(w->a.pose + 12 * i, in_space, in_link);
}

/* Angle about the axis from the reference in space to that in the link; of a slide the place of the link along it. */
static double amount(const Model *m, const Work *w, int i, double *twists, const double *X) {
  const double *u = along_axis(m, twists, i), origin[3] = {X[3], X[7], X[11]};
  double e[3], c[3], from[3], to[3], turn[3];
  if (!m->turns[i]) return dot(origin, u, 3);
  references(m, w, i, e, c);
  turned(X, c, turn);
  across(e, u, from);
  across(turn, u, to);
  cross(from, to, turn);
  return atan2(dot(turn, u, 3), dot(from, to, 3));
}

/* Its rate at rest, at a state with `twist_rates`. */
static double amount_rate(const Model *m, Work *w, int i) {
  const double *u = along_axis(m, w->twist, i), *change = along_axis(m, w->twist_rate, i), *V = w->moving + 6 * i;
  const double *X = w->pose + 12 * first_of(m, i), origin[3] = {X[3], X[7], X[11]}, part = dot(change, u, 3);
  double du[3], e[3], c[3], at[6], turn[3];
  FOR(r, 3) du[r] = change[r] - part * u[r];
  if (!m->turns[i]) {
    twist_about(V, origin, at);
    return dot(at + 3, u, 3) + dot(origin, du, 3);
  }
  references(m, w, i, e, c);
  const double in_space = turning(e, u, du);
  turned(X, c, e);
  cross(V, u, turn);
  FOR(r, 3) turn[r] = du[r] - turn[r];
  return dot(V, u, 3) + turning(e, u, turn) - in_space;
}

/* Legendre's polynomials P_0 ... P_POINTS at t. */
static void legendre(double t, double *P) {
  P[0] = 1.0, P[1] = t;
  for (int k = 2; k <= POINTS; k++) P[k] = ((2 * k - 1) * t * P[k - 1] - (k - 1) * P[k - 2]) / k;
}

/* Amounts at rest along the step from node a to b, as Legendre's series of their rates at Gauss's points. */
static int rest_along(const Model *m, Work *w) {
  static const double point[POINTS / 2] = {0.18343464249564980, 0.52553240991632899, 0.79666647741362674, 0.96028985649753623};
  static const double weight[POINTS / 2] = {0.36268378337836198, 0.31370664587788729, 0.22238103445337447, 0.10122853629037626};
  const double h = *w->b.at - *w->a.at;
  memset(w->series, 0, (size_t)POINTS * m->passives * sizeof(double));
  FOR(g, POINTS) {
    const double t = g % 2 ? point[g / 2] : -point[g / 2];
    double P[POINTS + 1], gap;
    on_curve(m, w, &w->arc, *w->a.at + 0.5 * (1.0 + t) * h, w->trial);
    int status = closed(m, w, w->trial, NULL, CLOSED);
    if (!status) status = velocities(m, w, w->direction, w->dq, &gap);
    if (status) return status;
    twist_rates(m, w, w->dq);
    legendre(t, P);
    FOR(i, m->passives) {
      const double rate = h * weight[g / 2] * amount_rate(m, w, i);
      FOR(k, POINTS) w->series[POINTS * i + k] += (k + 0.5) * P[k] * rate;
    }
  }
  return MGK_OK;
}

/* What is missing to rest at a state of the step, node a being at rest. */
static double missing(const Model *m, const Work *w, int i, double at) {
  const double t = 2.0 * (at - *w->a.at) / (*w->b.at - *w->a.at) - 1.0, whole = 8.0 * atan(1.0), *series = w->series + POINTS * i;
  double P[POINTS + 1], out = amount(m, w, i, w->a.twist, w->a.pose + 12 * i) - amount(m, w, i, w->twist, w->pose + 12 * first_of(m, i));
  legendre(t, P);
  out += 0.5 * (t + 1.0) * series[0];
  for (int k = 1; k < POINTS; k++) out += 0.5 * (P[k + 1] - P[k - 1]) / (2 * k + 1) * series[k];
  return m->turns[i] ? out - whole * floor(out / whole + 0.5) : out;
}

/* Closed by Newton from x, in place, as `closed` does, its passive links moved to where they are at rest at this place of the step. */
static int closed_at_rest(const Model *m, Work *w, double *x, double at, double *matrix) {
  double before = INFINITY;
  FOR(turn, MOST_TURNS) {
    double most = 0.0;
    int status = closed(m, w, x, matrix, CLOSED);
    if (!m->passives || *w->b.at <= *w->a.at) return status;
    if (!status) status = passive_motions(m, w);
    if (status) return status;
    memset(w->increment, 0, m->columns * sizeof(double));
    FOR(i, m->passives) {
      const double part = missing(m, w, i, at);
      FOR(c, m->columns) w->increment[c] += part * w->passive[i * m->columns + c];
      most = raised(most, fabs(part));
    }
    if (most <= UNTURNED || (most <= MISSING && most >= 0.5 * before)) return MGK_OK;
    if (!(most <= CORRECTION)) return MGK_STEP;
    advance(m, x, w->increment, x);
    before = most;
  }
  return MGK_STEP;
}

/* What is asked of a path: positions and what becomes of them. */
typedef struct {
  int count, with_forces, done;
  const int *order, *places;
  const double *q, *v, *a;
  double *out, *largest;
  size_t length;
  /* places and states of the nodes that lead there, unless NULL */
  double *node;
  int nodes, most_nodes;
} Asked;

static int at_place(const Asked *asked, int i) { return asked->order ? asked->order[i] : i; }

/* How far a position lies along the line that begins at `begin`. */
static double along_line(const Model *m, const Work *w, const Asked *asked, int i, const double *begin) {
  const double *q = asked->q + at_place(asked, i) * m->drives;
  double at = 0.0;
  FOR(c, m->drives) at += w->direction[c] * (q[c] - begin[c]);
  return at;
}

static void swapped(Node *p, Node *q) {
  const Node t = *p;
  *p = *q, *q = t;
}

/* A place on the line that is closed to rounding, where all moves as dq and ddq at a rate of the line and its change. */
static void made_known(const Model *m, Work *w, double at, const double *x, const double *dq, const double *ddq, double rate, double change) {
  swapped(&w->last, &w->other);
  *w->last.at = at;
  memcpy(w->last.x, x, m->states * sizeof(double));
  FOR(c, m->columns) w->last.rate[c] = dq[c] / rate, w->last.bend[c] = (ddq[c] - change * w->last.rate[c]) / (rate * rate);
  w->known++, w->curve.x = NULL;
}

/* The state at a place of a step, off the curve through the last places known and node b. */
static void predicted(const Model *m, Work *w, double at, double *x) {
  if (!w->curve.x || at > w->curve.until) {
    const int near = !w->curve.x && w->known > 1 && at - *w->last.at <= REACHED * (*w->last.at - *w->other.at);
    through(m, w, &w->last, &w->b, near ? &w->other : NULL, &w->curve);
  }
  on_curve(m, w, &w->curve, at, x);
}

/* One position of a certified step, read off its curve. What had to be corrected becomes a place of the curve, where its motion follows
 * the line. */
static int read_off(const Model *m, Work *w, Asked *asked, double at) {
  const int i = at_place(asked, asked->done), d = m->drives, inside = at < *w->b.at;
  const double *v = asked->v + i * d, *a = asked->a + i * d;
  if (inside) predicted(m, w, at, w->x);
  else memcpy(w->x, w->b.x, m->states * sizeof(double));
  const int moves = set_drives(m, w->x, asked->q + i * d);
  continued(m, w, fmin(at, *w->b.at));
  int status = w->stands && !moves ? MGK_OK : closed_at_rest(m, w, w->x, at, NULL);
  w->stands &= !moves;
  if (inside && (status || !(w->corrected <= w->allowed))) { /* the step's own curve, which the certificate is about */
    on_curve(m, w, &w->arc, at, w->x);
    set_drives(m, w->x, asked->q + i * d);
    status = closed_at_rest(m, w, w->x, at, NULL);
  }
  const int known = inside && w->corrected > 0.0;
  if (!status) status = put(m, w, w->x, v, a, asked->with_forces, asked->places, asked->out + i * asked->length, asked->largest);
  if (status || !known) return status;
  const double rate = dot(v, w->direction, d), change = dot(a, w->direction, d);
  double off = 0.0;
  FOR(c, d) off = raised(off, fabs(v[c] - rate * w->direction[c]) + fabs(a[c] - change * w->direction[c]));
  if (off <= STRAIGHT_ON * (fabs(rate) + fabs(change)) && fabs(change) < STEADY * rate * rate) made_known(m, w, at, w->x, w->dq, w->ddq, rate, change);
  return MGK_OK;
}

/* Along a straight line of the drives from node a, which lies at place 0, to `end` at a `length`; `until`: the positions on it. */
static int follow(const Model *m, Work *w, Asked *asked, const double *begin, const double *end, double length, int until) {
  double h = fmin(LONGEST, length), furthest = 0.0, *drive = w->column_value;
  int known = 0, status;
  w->known = 0;
  while (*w->a.at < length) {
    if (++w->steps > MOST_STEPS + asked->done) return MGK_TOO_FAR;
    h = fmin(h, NEAREST * w->a.reach);
    if (asked->done + AT_ONCE < until) h = fmin(h, raised(SHORTEST, along_line(m, w, asked, asked->done + AT_ONCE, begin) - *w->a.at));
    const Node *third = known ? &w->before : NULL;
    const double left = length - *w->a.at, step = h >= left ? left : h > 0.5 * left ? 0.5 * left : h;
    *w->b.at = step == left ? length : *w->a.at + step;
    if (known) {
      on_curve(m, w, &w->arc, *w->b.at, w->b.x);
    } else {
      FOR(c, m->columns) w->increment[c] = step * (w->a.rate[c] + 0.5 * step * w->a.bend[c]);
      advance(m, w->a.x, w->increment, w->b.x);
    }
    FOR(i, m->drives) drive[i] = step == left ? end[i] : begin[i] + *w->b.at * w->direction[i];
    set_drives(m, w->b.x, drive);
    double grown = 0.5;
    const int several = asked->done + SEVERAL < until && along_line(m, w, asked, asked->done + SEVERAL, begin) < *w->b.at;
    status = closed(m, w, w->b.x, w->b.matrix, several ? CLOSED : PASSED);
    if (!status) status = made_node(m, w, &w->b);
    if (!status && !certified(m, w, third, &grown)) status = MGK_STEP;
    if (!status && m->passives) status = rest_along(m, w);
    if (!status && m->passives) status = closed_at_rest(m, w, w->b.x, *w->b.at, w->b.matrix);
    if (!status && m->passives) status = made_node(m, w, &w->b);
    if (status) {
      h = fmin(0.8, grown) * step;
      if (h < SHORTEST) return status;
      if (known) through(m, w, &w->before, &w->a, NULL, &w->arc);
      furthest = h;
      continue;
    }
    if (m->passives) through(m, w, &w->a, &w->b, third, &w->arc);
    made_known(m, w, *w->a.at, w->a.x, w->a.rate, w->a.bend, 1.0, 0.0);
    for (; asked->done < until; asked->done++) {
      const double at = along_line(m, w, asked, asked->done, begin);
      if (at > *w->b.at && step != left) break;
      if ((status = read_off(m, w, asked, at))) return status;
    }
    if (asked->node) {
      if (asked->nodes == asked->most_nodes) return MGK_TOO_FAR;
      double *node = asked->node + asked->nodes++ * (1 + m->states);
      *node = *w->b.at;
      memcpy(node + 1, w->b.x, m->states * sizeof(double));
    }
    continued(m, w, *w->b.at);
    coordinates(m, w, w->b.x, w->dq);
    swapped(&w->before, &w->a);
    swapped(&w->a, &w->b);
    set_border(m, w, &w->a);
    /* where steps have to become shorter they go on to, by as much as over the last one; a step that needed no correction does not say
       how long the next may be, and without a bound the ratio of the two would be nothing */
    h = fmin(grown * step, 2.0 * LONGEST);
    const double next = h < furthest ? h * h / furthest : h;
    known = 1, furthest = h, h = fmin(fmin(LONGEST, 2.0 * step), next);
  }
  return MGK_OK;
}

/* Node a closed and factored at the state kept. */
static int stood(const Model *m, Work *w) {
  if (w->stands) return MGK_OK;
  memcpy(w->a.x, w->x, m->states * sizeof(double));
  const int status = closed(m, w, w->a.x, w->a.matrix, CLOSED);
  w->stands = !status && !m->passives;
  return status;
}

/* The first node of a line from the state kept. */
static int first_node(const Model *m, Work *w) {
  *w->a.at = w->told = 0.0;
  int status = stood(m, w);
  if (!status) status = made_node(m, w, &w->a);
  if (!status) set_border(m, w, &w->a);
  return status;
}

/* The direction from p to q; its length. */
static double towards(int n, const double *p, const double *q, double *out) {
  double length = 0.0;
  FOR(i, n) out[i] = q[i] - p[i], length += out[i] * out[i];
  length = sqrt(length);
  FOR(i, n) out[i] = length > 0.0 ? out[i] / length : 0.0;
  return length;
}

/* The polygon of the drives through all positions asked for, from the state kept. */
static int along(const Model *m, Work *w, Asked *asked) {
  const int d = m->drives;
  while (asked->done < asked->count) {
    const double here = 1e-14 * raised(1.0, size_of(w->drive, d)), *end = w->drive;
    double length = 0.0;
    int rest = asked->done, status; /* positions up to it are where the drives stand */
    while (rest < asked->count && (length = towards(d, w->drive, asked->q + at_place(asked, rest) * d, w->direction)) <= here) rest++;
    int until = rest;
    if (rest == asked->count) FOR(i, d) w->direction[i] = i == 0;
    for (; until < asked->count; until++) {
      const double *next = asked->q + at_place(asked, until) * d;
      double ahead = 0.0, square = 0.0;
      FOR(i, d) ahead += (next[i] - end[i]) * w->direction[i], square += (next[i] - end[i]) * (next[i] - end[i]);
      if (!(ahead >= (1.0 - STRAIGHT_ON) * sqrt(square))) break;
      end = next;
    }
    if (until > rest) length = towards(d, w->drive, end, w->direction);
    if ((status = first_node(m, w))) return status;
    *w->b.at = 0.0, w->b.condition = w->a.condition;
    memcpy(w->b.x, w->a.x, m->states * sizeof(double));
    for (; asked->done < rest; asked->done++) if ((status = read_off(m, w, asked, 0.0))) return status;
    if (rest == asked->count) break;
    w->stands = 0;
    memcpy(w->line_begin, w->drive, d * sizeof(double));
    if ((status = follow(m, w, asked, w->line_begin, end, length, until))) return status;
    memcpy(w->drive, end, d * sizeof(double)); /* the last position on it stands in w->x */
  }
  return MGK_OK;
}

/* --- what is called ---------------------------------------------------------------------------------------------------------------- */

/* Begun at the start of P, and closed there. */
static int begun(const Model *m, Work *w) {
  memcpy(w->x, m->start, m->states * sizeof(double));
  FOR(i, m->drives) w->drive[i] = w->x[m->column_state[m->drive[i]]];
  FOR(f, m->factors) w->begun[f] = w->angle[f] = 0.0;
  memcpy(w->border, m->border, (size_t)m->passives * m->columns * sizeof(double));
  w->stands = 0;
  const int status = stood(m, w);
  if (!status) memcpy(w->x, w->a.x, m->states * sizeof(double));
  coordinates(m, w, w->x, w->record + m->states);
  return status;
}

static void opened(const int *I, const double *P, void *state, Model *m, Work *w) {
  read_tables(I, P, m);
  lay_out(m, state, w);
  w->steps = w->evaluations = w->factorizations = w->stands = 0;
}

int mgk_start(const int *I, const double *P, void *state) {
  Model m;
  Work w;
  if (I[MGK_IS_FORMAT] != MGK_FORMAT) return MGK_FORMAT_ERROR;
  opened(I, P, state, &m, &w);
  return begun(&m, &w);
}

int mgk_path(const int *I, const double *P, void *state, int count, const int *order, const double *q, const double *v, const double *a,
             int with_forces, double *out, double *largest, int *done, long *work) {
  Model m;
  Work w;
  int places[MGK_PARTS + 1];
  *done = 0;
  if (I[MGK_IS_FORMAT] != MGK_FORMAT) return MGK_FORMAT_ERROR;
  opened(I, P, state, &m, &w);
  int status = begun(&m, &w);
  if (status) return status;
  mgk_record(I, places);
  Asked asked = {count, with_forces, 0, order, places, q, v, a, out, largest, places[with_forces ? MGK_PARTS : MGK_POINTS], NULL, 0, 0};
  status = along(&m, &w, &asked);
  *done = asked.done;
  work[0] += w.steps, work[1] += w.evaluations, work[2] += w.factorizations;
  return status;
}

int mgk_solve(const int *I, const double *P, void *state, const double *q, const double *v, const double *a, double *effort,
              double *reaction, double *position) {
  Model m;
  Work w;
  int places[MGK_PARTS + 1];
  double largest[2] = {0.0, 0.0};
  if (I[MGK_IS_FORMAT] != MGK_FORMAT) return MGK_FORMAT_ERROR;
  FOR(i, I[MGK_DRIVES]) if (!isfinite(q[i]) || !isfinite(v[i]) || !isfinite(a[i])) return MGK_NOT_FINITE;
  opened(I, P, state, &m, &w);
  mgk_record(I, places);
  const double L = *m.unit;
  const int d = m.drives;
  double *asked_of = w.asked, *record = w.record;
  FOR(i, d) {
    const double unit = m.is_length[m.drive[i]] ? L : 1.0;
    asked_of[i] = q[i] / unit, asked_of[d + i] = v[i] / unit, asked_of[2 * d + i] = a[i] / unit;
  }
  Asked asked = {1, 1, 0, NULL, places, asked_of, asked_of + d, asked_of + 2 * d, record, largest, 0, NULL, 0, 0};
  memcpy(w.kept, w.x, w.n_kept * sizeof(double));
  int status = along(&m, &w, &asked);
  if (!status && m.rubs && REAL_PART(record[places[MGK_UNSURE]]) == 1.0) status = MGK_FRICTION;
  if (status) {
    memcpy(w.x, w.kept, w.n_kept * sizeof(double));
    return status;
  }
  if (position) memcpy(position, record + places[MGK_COORDINATES], m.columns * sizeof(double));
  if (reaction) FOR(k, m.pairs) given_out(&m, record, places, k, reaction + 6 * k);
  if (effort) FOR(i, d) effort[i] = effort_out(&m, record, places, m.drive[i]);
  return MGK_OK;
}
#endif

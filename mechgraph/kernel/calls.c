/* What the package calls beside the functions of kernel.h: many positions or variants at once, poses of links, rows of fits (tracks.c), and
 * derivatives by complex numbers (derivative.c). */
#include "kernel.c"
#include "motion.c"

/* Poses of all links of the kept state in internal units, three rows of four each. */
void mgk_poses(const int *I, const double *P, void *state, double *poses) {
  Model m;
  Work w;
  opened(I, P, state, &m, &w);
  evaluate(&m, &w, w.x);
  FOR(b, m.links) product(w.pose + 12 * b, m.base + 12 * b, poses + 12 * b);
}

/* Where the drives of the kept state stand. */
void mgk_drives(const int *I, const double *P, void *state, double *q) {
  Model m;
  Work w;
  opened(I, P, state, &m, &w);
  FOR(i, m.drives) q[i] = w.drive[i] * (m.is_length[m.drive[i]] ? *m.unit : 1.0);
}

/* Closure rows at states x[count][states], of mechanisms `which` of those with tables P[mechanisms][numbers], none of them driven: what they leave
 * open left[count][rows], and their derivatives J[count][rows][columns]. */
void mgk_closure(const int *I, const double *P, int numbers, int count, const int *which, const double *x, void *memory, double *left, double *J) {
  Model m;
  Work w;
  FOR(i, count) {
    if (!i || which[i] != which[i - 1]) opened(I, P + (size_t)which[i] * numbers, memory, &m, &w);
    evaluate(&m, &w, x + (size_t)i * m.states);
    memcpy(left + (size_t)i * m.rows, w.residual, m.rows * sizeof(double));
    fill(&m, w.S, w.middle, NULL, NULL, J + (size_t)i * m.rows * m.columns);
  }
}

/* n states one after the other, each led on from the last good one: motion[3][n][drives] = q, v, a, and of every state what mgk_solve gives,
 * poses too unless NULL. status[n]; NaN where that is not 0. Not 0, and nothing done, where a number of `motion` is not finite. */
int mgk_table(const int *I, const double *P, void *state, int n, const double *motion, double *effort, double *reaction, double *position,
              int *status, double *poses) {
  const int d = I[MGK_DRIVES], sizes[3] = {d, 6 * I[MGK_PAIRS], I[MGK_COLUMNS]};
  FOR(i, 3 * n * d) if (!isfinite(motion[i])) return MGK_NOT_FINITE;
  FOR(i, n) {
    double *out[3] = {effort + i * sizes[0], reaction + i * sizes[1], position + i * sizes[2]};
    const double *q = motion + i * d;
    status[i] = mgk_solve(I, P, state, q, q + n * d, q + 2 * n * d, out[0], out[1], out[2]);
    if (status[i]) FOR(k, 3) FOR(j, sizes[k]) out[k][j] = NAN;
    if (poses) mgk_poses(I, P, state, poses + (size_t)12 * i * I[MGK_LINKS]);
  }
  return MGK_OK;
}

/* The right-hand side of the equations of motion (motion.c) at states one by one: y[count][2n] = u, v of the first n drives, increments u
 * counted from x0, where the others have the positions, rates and accelerations p[count][3][drives - n]. Every state is predicted from a
 * `known` one, x, q', q'', a time h before; found: the same of this one. rough, way[count][columns]: what slips (NULL: nothing rubs).
 * out[count][2n + 4]: u', v', what friction takes, the power, the steepness and the condition. */
int mgk_motion(const int *I, const double *P, void *memory, int n, int stored, const double *x0, const int *rough, int count, const double *y,
               const double *p, const double *way, const double *known, const double *h, double *found, double *out) {
  Model m;
  Work w;
  Motion at;
  opened_motion(I, P, memory, &m, &w, &at);
  const int c = m.columns, d = m.drives, size = m.states + 2 * c;
  FOR(k, count) {
    const double *dq = known + m.states, *ddq = dq + c;
    FOR(i, c) w.increment[i] = *h * (dq[i] + 0.5 * *h * ddq[i]);
    advance(&m, known, w.increment, found);
    int status = closed_at(&m, &w, &at, n, x0, y, p, found);
    if (status) return status;
    FOR(i, d) at.y[i] = i < n ? y[n + i] : p[d - 2 * n + i];
    status = accelerations(&m, &w, &at, n, found, at.y, p + 2 * (d - n), stored, rough, way, out + 2 * n);
    if (status) return status;
    rates_of_increments(&m, &w, &at, n, x0, found, out);
    memcpy(out + n, at.a, n * sizeof(double));
    memcpy(found + m.states, w.dq, c * sizeof(double)), memcpy(found + m.states + c, w.ddq, c * sizeof(double));
    out[2 * n + 2] = fmax(1.0, size_of(at.Z, n * c));
    fill(&m, w.S, w.middle, NULL, NULL, w.a.matrix);
    out[2 * n + 3] = made_inverse(&m, &w, w.a.matrix);
    y += 2 * n, p += 3 * (d - n), known += size, h++, found += size, out += 2 * n + 4;
    if (way) way += c;
  }
  return MGK_OK;
}

/* Nodes of certified steps of one drive from a closed state x to where it is at `end`: of each its distance and state in node[most][1 + states].
 * How many there are; fewer than lead there where a step is refused. */
int mgk_nodes(const int *I, const double *P, void *memory, const double *x, double end, int most, double *node) {
  Model m;
  Work w;
  int places[MGK_PARTS + 1];
  double largest[2] = {0.0, 0.0}, v = 0.0;
  opened(I, P, memory, &m, &w);
  mgk_record(I, places);
  m.start = x;
  if (begun(&m, &w)) return 0;
  Asked asked = {1, 0, 0, NULL, places, &end, &v, &v, w.record, largest, 0, node, 0, most};
  along(&m, &w, &asked);
  return asked.nodes;
}

/* The equation of motion of mobility 1 (response/along_path.py) at states x[count][states] near closed ones, which are closed in place, with
 * the one drive at u[count]; `stored` of the loads have a potential energy. out[count][6]: mass, forces of the stored loads, and of the
 * others at rest and for a unit rate, steepness, condition. */
int mgk_along(const int *I, const double *P, void *memory, int count, int stored, const double *u, double *x, double *out) {
  Model m;
  Work w;
  Motion at;
  opened_motion(I, P, memory, &m, &w, &at);
  const int links = 6 * m.links;
  FOR(i, count) {
    double *own = x + (size_t)i * m.states, *term = out + 6 * (size_t)i, force[3];
    set_drives(&m, own, u + i);
    const int status = closed(&m, &w, own, w.a.matrix, CLOSED);
    if (status) return status;
    term[5] = made_inverse(&m, &w, w.a.matrix);
    if (!(term[5] <= FAIR)) return MGK_SINGULAR;
    if (sensitivity(&m, &w, &at) > INDEPENDENT) return MGK_CONTRADICTION;
    carried_along(&m, &w, at.Z, at.V, at.momentum);
    term[0] = dot(at.V, at.momentum, links);
    if (!(term[0] > 0.0)) return MGK_NOT_FINITE;
    FOR(k, 3) { /* stored loads at rest, the others for unit rates to and fro */
      Model some = m;
      if (k) some.loads -= stored, some.load += 4 * stored;
      else some.loads = stored;
      const double rate = k == 0 ? 0.0 : k == 1 ? 1.0 : -1.0;
      FOR(j, links) w.V[j] = rate * at.V[j];
      FOR(c, m.columns) w.dq[c] = rate * at.Z[c];
      loads(&some, &w, own);
      force[k] = dot(at.V, w.applied, links) + dot(at.Z, w.given, m.columns);
    }
    term[1] = force[0], term[2] = 0.5 * (force[1] + force[2]), term[3] = 0.5 * (force[1] - force[2]), term[4] = 0.0;
    FOR(c, m.columns) if (m.column_state[c] >= 0) term[4] = raised(term[4], fabs(at.Z[c]));
  }
  return MGK_OK;
}

/* A path of mobility 1 tabulated in pieces: series of `points` Chebyshev polynomials of the four terms of its equation of motion, behind both
 * ends of a piece; about: places up to which it is tabulated, and between which a table may be asked for, where it begins, whole turn after
 * which all comes back (0: none), its sense, mass at which rates are told. */
enum { LOW, HIGH, LEAST, MOST, BEGIN, TURN, SENSE, MASS };
typedef struct { int pieces, points; const double *piece, *about; double *asked; } Table;

/* y' of y = (u, w, lost, work); 1 where it is not tabulated yet, the place `asked` for. */
static int rates_along(const Table *s, const double *y, double *out) {
  const double *about = s->about, turn = about[TURN], sense = about[SENSE];
  const double u = turn > 0.0 ? y[0] - turn * (sense * floor(sense * (y[0] - about[BEGIN]) / turn)) : y[0];
  double term[4] = {NAN, NAN, NAN, NAN};
  if (u >= about[LOW] && u <= about[HIGH] && s->pieces) {
    int first = 0, behind = s->pieces;
    const size_t width = 2 + 4 * s->points;
    while (behind - first > 1) {
      const int middle = (first + behind) / 2;
      if (fmin(s->piece[middle * width], s->piece[middle * width + 1]) <= u) first = middle;
      else behind = middle;
    }
    const double *p = s->piece + first * width, z = (2.0 * u - p[0] - p[1]) / (p[1] - p[0]);
    FOR(k, 4) {
      double one = 0.0, two = 0.0;
      for (int i = s->points - 1; i > 0; i--) {
        const double next = p[2 + 4 * i + k] + 2.0 * z * one - two;
        two = one, one = next;
      }
      term[k] = p[2 + k] + z * one - two;
    }
  } else if (u > about[LEAST] && u < about[MOST]) return *s->asked = y[0], 1;
  const double size = sqrt(term[0] / about[MASS]), v = y[1] / size, rest = term[2] + v * term[3];
  out[0] = v, out[1] = (term[1] + rest) / (size * about[MASS]), out[2] = 0.0 * v, out[3] = v * rest;
  if (!(term[0] > 0.0)) FOR(i, 4) out[i] = NAN;
  return 0;
}

/* Stages `first` to `last` of an explicit Runge-Kutta method with coefficients A[last - first][width] into slope[last][4]. */
static int stages_along(const Table *s, int first, int last, int width, const double *A, double h, const double *begin, double *slope) {
  for (int i = first; i < last; i++, A += width) {
    double y[4];
    FOR(k, 4) {
      y[k] = 0.0;
      FOR(j, i) y[k] += A[j] * slope[4 * j + k];
      y[k] = begin[k] + h * y[k];
    }
    if (rates_along(s, y, slope + 4 * i)) return 1;
  }
  return 0;
}

/* A step of the method of Dormand and Prince of order 8 along a table, by the rules of scipy's DOP853, of which rule[] has A, B, E3, E5,
 * A_EXTRA and D, from at[] = time, length, and y with its slope, which become those at its end, towards `bound`. dense[7][4]: the
 * polynomial over the step. 0, or 1 where it is shorter than rounding, 2 where it leads to a place at[2] that is not tabulated: nothing else is changed. */
int mgk_step_along(int pieces, int points, const double *piece, const double *about, const double *rule, double bound, double longest,
                   double relative, const double *absolute, double *at, double *y, double *slope, double *dense, int *evaluations) {
  enum { N = 12, ALL = 16 };
  const Table table = {pieces, points, piece, about, at + 2};
  const double *A = rule, *B = A + N * N, *E3 = B + N, *E5 = E3 + N + 1, *A_EXTRA = E5 + N + 1, *D = A_EXTRA + 3 * ALL;
  const double least = 10.0 * (nextafter(at[0], INFINITY) - at[0]);
  double K[4 * ALL], end[4], length = fmax(fmin(at[1], longest), least), error, there, h;
  int evaluated = 3;
  memcpy(K, slope, 4 * sizeof(double));
  for (int refused = 0;; refused = 1) {
    if (length < least) return 1;
    there = fmin(at[0] + length, bound), h = there - at[0];
    evaluated += N;
    if (stages_along(&table, 1, N, N, A + N, h, y, K)) return 2;
    double fifth = 0.0, third = 0.0;
    FOR(k, 4) {
      end[k] = 0.0;
      FOR(j, N) end[k] += B[j] * K[4 * j + k];
      end[k] = y[k] + h * end[k];
    }
    if (rates_along(&table, end, K + 4 * N)) return 2;
    FOR(k, 4) {
      double e5 = 0.0, e3 = 0.0;
      const double scale = absolute[k] + relative * fmax(fabs(y[k]), fabs(end[k]));
      FOR(j, N + 1) e5 += E5[j] * K[4 * j + k], e3 += E3[j] * K[4 * j + k];
      fifth += e5 * e5 / (scale * scale), third += e3 * e3 / (scale * scale);
    }
    error = fifth == 0.0 && third == 0.0 ? 0.0 : h * fifth / sqrt(4.0 * (fifth + 0.01 * third));
    const double grown = 0.9 * pow(error, -0.125);
    if (error < 1.0) {
      length = h * (refused ? fmin(1.0, grown) : fmin(10.0, grown));
      break;
    }
    length = h * fmax(0.2, grown);
  }
  if (stages_along(&table, N + 1, ALL, ALL, A_EXTRA, h, y, K)) return 2;
  FOR(k, 4) {
    double *F = dense + k;
    F[0] = end[k] - y[k], F[4] = h * K[k] - F[0], F[8] = 2.0 * F[0] - h * (K[4 * N + k] + K[k]);
    FOR(i, 4) {
      F[12 + 4 * i] = 0.0;
      FOR(j, ALL) F[12 + 4 * i] += h * D[i * ALL + j] * K[4 * j + k];
    }
  }
  at[0] = there, at[1] = length, *evaluations += evaluated;
  memcpy(y, end, 4 * sizeof(double)), memcpy(slope, K + 4 * N, 4 * sizeof(double));
  return 0;
}

/* One step from a mechanism of tables m[0], closed in node a, by m[1] at `part` of it to m[2]: whether node b there is on the same regular
 * branch.
 *
 * The closure matrix on the way is, to third order, the parabola through its three values A, M and B, which lies in the hull of its Bezier
 * points A, C and B: see `certified`, and there too why another branch is not reached, the curve of the states being the chord. */
static int led(const Model *m, Work *w, double part) {
  const int n = m->unknowns, columns = m->columns;
  const double rest = 1.0 - part;
  Node *a = &w->a, *b = &w->b, *middle = &w->before;
  double *step = w->increment;
  memcpy(middle->x, a->x, m->states * sizeof(double));
  if (closed(m + 1, w, middle->x, middle->matrix, CLOSED)) return 0;
  difference(m, middle->x, a->x, step);
  FOR(c, columns) step[c] *= rest / part;
  advance(m, middle->x, step, b->x);
  if (closed(m + 2, w, b->x, b->matrix, CLOSED)) return 0;
  b->condition = made_inverse(m, w, b->matrix);
  FOR(i, n) FOR(j, n) {
    double whole = 0.0, bend = 0.0;
    FOR(r, n) {
      const int at = w->row[r] * n + j;
      const double A = a->matrix[at], B = b->matrix[at], C = (middle->matrix[at] - rest * rest * A - part * part * B) / (2.0 * part * rest);
      whole += w->inverse[i * n + r] * (B - A), bend += w->inverse[i * n + r] * (B - C);
    }
    w->change[i * n + j] = raised(fabs(whole), fabs(bend));
  }
  difference(m, b->x, a->x, step);
  FOR(c, columns) step[c] *= part;
  advance(m, a->x, step, w->trial);
  difference(m, middle->x, w->trial, step);
  const double worst = fmax(a->condition, b->condition);
  return worst <= FAIR && radius(w->change, n, w->bound) <= DEPARTURE && size_of(step, columns) * fmax(1.0, worst) <= ALONE;
}

/* Mechanisms whose numbers change, their drives at rest: one step each from numbers `from`, closed in x[count][states], to `end` by
 * `middle` at `part` of it, each [count][numbers]; all from the first of `from` and x where they are not `apart`. whole[count]: 1 where x is now the certified state at
 * the end; else it stays. */
void mgk_lead(const int *I, int count, int numbers, int apart, double part, const double *from, const double *middle, const double *end, void *state,
              double *x, int *whole) {
  Model m[3];
  Work w;
  opened(I, from, state, m, &w);
  FOR(i, count) {
    const size_t at = (size_t)i * numbers;
    read_tables(I, from + (apart ? at : 0), m), read_tables(I, middle + at, m + 1), read_tables(I, end + at, m + 2);
    double *own = x + (size_t)i * m->states;
    if (apart || !i) {
      memcpy(w.a.x, own, m->states * sizeof(double));
      w.a.condition = closed(m, &w, w.a.x, w.a.matrix, CLOSED) ? INFINITY : made_inverse(m, &w, w.a.matrix);
    }
    whole[i] = led(m, &w, part);
    if (whole[i]) memcpy(own, w.b.x, m->states * sizeof(double));
  }
}

/* Mechanisms of one kind, each with tables P[count][numbers] and positions [count][each][drives], taken in order[each] from the start along
 * `lines` polygons that end at places ends[count][lines] of the order. out: a record a position; those of a mechanism with a position that is not
 * given, for which whole[count] is 0, are NaN. largest, work: as of mgk_path. */
void mgk_variants(const int *I, int count, int numbers, const double *P, void *state, int each, int lines, const int *ends, const int *order,
                  const double *q, const double *v, const double *a, int forces, double *out, int *whole, double *largest, long *work) {
  int places[MGK_PARTS + 1], done;
  mgk_record(I, places);
  const int length = places[forces ? MGK_PARTS : MGK_POINTS], drives = I[MGK_DRIVES];
  FOR(i, count) {
    const size_t at = (size_t)i * each;
    double *own = out + at * length;
    whole[i] = 1;
    for (int l = 0, first = 0, last; l < lines && whole[i]; l++, first = last) {
      last = ends[i * lines + l];
      whole[i] = first == last || !mgk_path(I, P + (size_t)i * numbers, state, last - first, order + at + first, q + at * drives, v + at * drives,
                                            a + at * drives, forces, own, largest, &done, work);
    }
    if (!whole[i]) FOR(j, each) FOR(k, length) own[(size_t)j * length + k] = NAN;
  }
}

typedef double number;
#define creal(x) (x)
#define cimag(x) 0.0
#define cabs(x) fabs(x)
#include "tracks.c"

/* Motion under given loads: accelerations of independent freedoms, for any of the package's steppers, and steps of an integrator of its own.
 * Friction of what slips is solved beside them, see force/friction.py: reactions and accelerations are linear in it.
 *
 * The principle of virtual power along every independent motion Z_k eliminates the reactions, see response/motion_equations.py:
 *   M a = Q,   M_kl = sum V_k . I V_l,   Q_k = sum V_k . (W - I A_0 - V x* I V) + Z_k . given.
 * "Drives" of the tables are here the independent freedoms, and behind them the prescribed ones. Efforts that are
 * given from outside are the last loads of the tables, one a drive.
 * Sources: Kane and Levinson, Dynamics, 1985, chapter 6; Dormand and Prince, J. Comp. Appl. Math. 6 (1980) 19-26.
 */
static const double LARGEST_CORRECTION = 1.0; /* corrections to a closed state above which a step was too long */
static const double LAST_STEP = 1e-13;        /* difference from the independent coordinates asked for that is rounding */
static const double RESISTED = 1e-9;          /* pivot of the mass matrix in unit inertias above which every motion has inertia */
static const double VANISHING = 1e-100;       /* rate up to which a freedom is about to slip */
enum { CLOSING_STEPS = 12, STAGES = 7 };

typedef struct {
  /* kept between calls: rates, the step, and which freedoms are independent */
  double *rate, *step;
  int *drive, *unknown, *place;
  double *kept, *load_number;
  double *Z, *V, *momentum, *mass, *unit, *force, *a, *off, *yields, *guess, *begin, *speed, *y, *slope;
  size_t n_kept;
} Motion;

/* The memory of what a motion needs, behind that of a state; its size in bytes. */
static size_t lay_out_motion(const Model *m, int load_numbers, double *memory, Motion *at) {
  const size_t d = m->drives, c = m->columns, n = m->links;
  size_t size = 0;
#define TAKE(name, count) at->name = taken(&memory, &size, (count))
  TAKE(rate, c), TAKE(step, 1);
  at->drive = (int *)taken(&memory, &size, d), at->unknown = (int *)taken(&memory, &size, m->unknowns);
  at->place = (int *)taken(&memory, &size, c);
  at->n_kept = size;
  TAKE(kept, at->n_kept), TAKE(load_number, load_numbers);
  TAKE(Z, d * c), TAKE(V, 6 * n * d), TAKE(momentum, 6 * n * d), TAKE(mass, d * (d + 1)), TAKE(unit, d), TAKE(force, d), TAKE(a, d), TAKE(off, 2 * c);
  TAKE(yields, m->rubs ? 6 * n * c : 0);
  TAKE(guess, m->states), TAKE(begin, m->states), TAKE(speed, 2 * c), TAKE(y, 6 * d), TAKE(slope, STAGES * 2 * d);
#undef TAKE
  return size * sizeof(double);
}

/* Rates of all freedoms for a unit rate of every drive, at a state just factored; what the closure leaves of them. */
static magnitude sensitivity(const Model *m, Work *w, Motion *at) {
  magnitude gap = 0.0;
  double *unit = at->force;
  FOR(k, m->drives) {
    FOR(i, m->drives) unit[i] = i == k;
    gap = fmax(gap, completed(m, w, unit, NULL, 0.0, at->Z + k * m->columns));
  }
  return gap;
}

/* Closed from x, in place: the first n drives at increments u from x0, the others at p; evaluated and factored there. With rotations among
 * the drives what Newton leaves of u is settled by the motions Z. */
static int closed_at(const Model *m, Work *w, Motion *at, int n, const double *x0, const double *u, const double *p, double *x) {
  double before = INFINITY, sum = 0.0, step = INFINITY, off;
  int turns = 0;
  FOR(i, m->drives) {
    const int s = m->column_state[m->drive[i]];
    if (s < 0) turns = 1;
    else x[s] = i < n ? x0[s] + u[i] : p[i - n];
  }
  FOR(i, CLOSING_STEPS) {
    const double left = evaluate(m, w, x);
    double *y = at->off, *moved = at->off + m->columns;
    off = 0.0;
    if (!(left < 1.0)) return MGK_STEP;
    if (turns) {
      difference(m, x, x0, y);
      FOR(k, n) off = fmax(off, fabs(u[k] - y[m->drive[k]]));
    }
    const int done = off <= LAST_STEP && (left <= CLOSED * w->reach || (left >= 0.5 * before && left <= ACCEPTED * w->reach));
    if (done || turns || !(step < REUSED)) {
      fill(m, w->S, w->middle, NULL, NULL, w->lu);
      if (!eliminate(m, w)) return MGK_SINGULAR;
    }
    if (done) return MGK_OK;
    double *right = w->row_value, *found = w->column_value, *dq = w->increment;
    FOR(r, m->rows) right[r] = -w->residual[r];
    solve(m, w, right, found);
    memset(dq, 0, m->columns * sizeof(double));
    FOR(j, m->unknowns) dq[m->unknown[j]] = found[j];
    if (turns) {
      sensitivity(m, w, at);
      tangent(m, y, dq, moved, NULL);
      const int wide = n + 1;
      FOR(r, n) at->mass[r * wide + n] = u[r] - y[m->drive[r]] - moved[m->drive[r]];
      FOR(k, n) {
        tangent(m, y, at->Z + k * m->columns, moved, NULL);
        FOR(r, n) at->mass[r * wide + k] = moved[m->drive[r]];
      }
      if (!reduced(at->mass, n, wide)) return MGK_SINGULAR;
      FOR(k, n) FOR(c, m->columns) dq[c] += at->Z[k * m->columns + c] * at->mass[k * wide + n];
    }
    step = fmax(off, size_of(dq, m->columns)), sum += step, before = left;
    if (!(sum <= LARGEST_CORRECTION)) return MGK_STEP;
    advance(m, x, dq, x);
  }
  return MGK_NOT_CLOSED;
}

/* Twists of all links for rates dq, and their momenta about the origin. */
static void carried_along(const Model *m, const Work *w, const double *dq, double *V, double *momentum) {
  memset(V + 6 * m->frame_link, 0, 6 * sizeof(double));
  FOR(t, m->pairs - m->loops) {
    const int *step = m->walk + 4 * t, k = step[0];
    const double sense = step[1] ? 1.0 : -1.0;
    memcpy(V + 6 * step[3], V + 6 * step[2], 6 * sizeof(double));
    for (int c = first_column(m, k); c < first_column(m, k + 1); c++) add_part(6, sense * dq[c], w->S + 6 * c, V + 6 * step[3]);
  }
  FOR(b, m->links) {
    const double *X = w->pose + 12 * b, *T = V + 6 * b, *J = m->inertia + 6 * b;
    const double I[9] = {J[0], J[3], J[4], J[3], J[1], J[5], J[4], J[5], J[2]};
    double c[3], v[3], turn[3], h[3], *out = momentum + 6 * b;
    point_of(X, m->center + 3 * b, c);
    cross(T, c, v);
    FOR(i, 3) out[3 + i] = m->mass[b] * (T[3 + i] + v[i]);
    turned_back(X, T, turn);
    FOR(i, 3) h[i] = dot(I + 3 * i, turn, 3);
    turned(X, h, out);
    cross(c, out + 3, v);
    FOR(i, 3) out[i] += v[i];
  }
}

/* The mass matrix of the first n, in coordinates of unit inertia `unit`, factored in place (Cholesky); 0 where a motion may have no inertia. */
static int masses_factored(int n, int d, double *M, double *unit) {
  FOR(i, n) {
    unit[i] = sqrt(M[i * d + i]);
    if (!(unit[i] > 0.0)) return 0;
  }
  FOR(i, n) FOR(j, n) M[i * d + j] /= unit[i] * unit[j];
  FOR(i, n) {
    const double pivot = M[i * d + i] - dot(M + i * d, M + i * d, i);
    if (!(pivot > RESISTED)) return 0;
    M[i * d + i] = sqrt(pivot);
    for (int r = i + 1; r < n; r++) M[r * d + i] = (M[r * d + i] - dot(M + r * d, M + i * d, i)) / M[i * d + i];
  }
  return 1;
}

/* a with M a = Q over the first n by that factorization. */
static void accelerated(int n, int d, const double *M, const double *unit, const double *Q, double *a) {
  FOR(i, n) a[i] = (Q[i] / unit[i] - dot(M + i * d, a, i)) / M[i * d + i];
  for (int i = n - 1; i >= 0; i--) {
    for (int r = i + 1; r < n; r++) a[i] -= M[r * d + i] * a[r];
    a[i] /= M[i * d + i];
  }
  FOR(i, n) a[i] /= unit[i];
}

/* Accelerations a of the first n drives added: to those of all freedoms, and as inertia wrenches to those on the links. */
static void add_accelerations(const Model *m, Work *w, const Motion *at, int n, const double *a) {
  FOR(k, n) {
    add_part(m->columns, a[k], at->Z + k * m->columns, w->ddq);
    add_part(6 * m->links, -a[k], at->momentum + k * 6 * m->links, w->inertial);
  }
}

/* The rates d at which bodies slide on each other that may roll, at rates of all freedoms: see `force.friction.Grip`; whether a place is theirs. */
static int slides_of(const Model *m, const Work *w, int of, const double *rate, double *d) {
  FOR(l, m->loads) {
    const int *load = m->load + 4 * l, kind = load[0], teeth = kind == MGK_TEETH;
    const double *n = m->load_number + load[3];
    double twist[6], normal[3], at[3];
    if (teeth ? -2 - load[1] != of : load[1] != of || (kind != MGK_CONTACT && kind != MGK_OPENING)) continue;
    twist_at(m, w, load, rate, twist);
    memcpy(d, twist, 3 * sizeof(double));
    if (teeth && n[MGK_SLIDE_OF] <= 0.5) return 1;
    if (teeth) point_of(w->pose + 12 * m->line[2 * load[1] + 1], n + MGK_MESHES_AT, at);
    else {
      const int opens = kind == MGK_OPENING;
      memcpy(normal, opens ? w->S + 6 * (int)n[MGK_SLIDE_OF] + 3 : w->reaction + 6 * load[1] + 3, sizeof normal);
      made_unit(normal, 0.0);
      touching(w, load[1], (int)n[opens ? MGK_TURN_OF : MGK_SLIDE_OF], normal, n[MGK_RADIUS], at);
    }
    sliding_at(twist, at, d);
    if (!teeth) add_part(3, -dot(d, normal, 3), normal, d);
    return 1;
  }
  return 0;
}

/* Rates that tell where friction acts: those of freedoms that slip, by their `way`, on the side of their ways also where they have just passed
 * zero, so that the motion is smooth there. `rough`: how many slip together, then of each how many freedoms and these, and of bodies that
 * may roll on each other their pair (of teeth -2 - line, else -1). */
static void slipping(const Model *m, Work *w, const int *rough, const double *way) {
  const int *one = rough + 1;
  memset(w->slip, 0, m->columns * sizeof(double));
  FOR(r, *rough) {
    const int n = one[0], *column = one + 2;
    double fastest = 0.0, slips = 0.0, along = 0.0, now[3], before[3], least = VANISHING;
    FOR(i, n) {
      const int c = column[i];
      along += w->dq[c] * way[c], fastest = fmax(fastest, fabs(w->dq[c])), slips = fmax(slips, fabs(way[c]));
    }
    if (one[1] != -1 && slides_of(m, w, one[1], w->dq, now) && slides_of(m, w, one[1], way, before)) {
      least = fmax(least, 100.0 * TURNING * fastest), fastest = size_of(now, 3), along = dot(now, before, 3);
    }
    FOR(i, n) w->slip[column[i]] = !(slips > 0.0) ? 0.0 : fastest <= least ? VANISHING * way[column[i]] : along < 0.0 ? -w->dq[column[i]] : w->dq[column[i]];
    one = column + n;
  }
}

/* Friction of what slips, beside the accelerations without it, whose inertia stands in w->inertial: adds to at->a what it brings. */
static int rubbing(const Model *m, Work *w, Motion *at, int n, const int *rough, const double *way) {
  const int d = m->drives, c = m->columns, links = 6 * m->links, places[MGK_PARTS + 1] = {0};
  if (efforts(m, w)) return MGK_SINGULAR;
  const int status = borne_on_flanks(m, w, w->inertial, w->record, places);
  if (status) return status;
  slipping(m, w, rough, way);
  double *more = at->off;
  memset(at->yields, 0, (size_t)links * c * sizeof(double));
  FOR(i, c) {
    FOR(k, n) at->force[k] = at->Z[k * c + i];
    accelerated(n, d, at->mass, at->unit, at->force, more);
    FOR(k, n) add_part(links, -more[k], at->momentum + k * links, at->yields + (size_t)i * links);
  }
  if (friction(m, w, w->inertial, at->yields, links, w->record, places)) return MGK_FRICTION;
  FOR(k, n) at->force[k] = dot(at->Z + k * c, w->rubbed, c);
  accelerated(n, d, at->mass, at->unit, at->force, more);
  add_accelerations(m, w, at, n, more);
  add_part(n, 1.0, more, at->a);
  add_part(c, 1.0, w->rubbed, w->given);
  return MGK_OK;
}

/* Accelerations of the first n drives (at->a) at a closed state just factored, with rates v of all drives and accelerations p of the others.
 * In w the rates and accelerations of all freedoms. `power`, unless NULL: what friction takes, and the power of all loads but the first
 * `stored`, and of the prescribed drives. `rough`, `way`: see `slipping`. */
static int accelerations(const Model *m, Work *w, Motion *at, int n, const double *x, const double *v, const double *p, int stored,
                         const int *rough, const double *way, double *power) {
  const int d = m->drives, c = m->columns, links = 6 * m->links;
  if (sensitivity(m, w, at) > INDEPENDENT) return MGK_CONTRADICTION;
  double *a = at->a;
  FOR(i, d) a[i] = i < n ? 0.0 : p[i - n];
  const int status = rates(m, w, v, a);
  if (status) return status;
  if (power) {
    Model rest = *m;
    rest.loads -= stored, rest.load += 4 * stored;
    loads(&rest, w, x);
    power[0] = 0.0, power[1] = dot(w->V, w->applied, links) + dot(w->dq, w->given, c);
  }
  loads(m, w, x);
  inertia(m, w);
  FOR(i, links) w->inertial[i] += w->applied[i];
  FOR(k, d) carried_along(m, w, at->Z + k * c, at->V + k * links, at->momentum + k * links);
  FOR(k, n) {
    FOR(l, k + 1) at->mass[k * d + l] = at->mass[l * d + k] = dot(at->V + k * links, at->momentum + l * links, links);
    at->force[k] = dot(at->V + k * links, w->inertial, links) + dot(at->Z + k * c, w->given, c);
  }
  if (!masses_factored(n, d, at->mass, at->unit)) return MGK_NOT_FINITE;
  accelerated(n, d, at->mass, at->unit, at->force, a);
  add_accelerations(m, w, at, n, a);
  if (way) {
    const int unsure = rubbing(m, w, at, n, rough, way);
    if (unsure) return unsure;
    if (power) power[0] = -dot(w->dq, w->rubbed, c), power[1] -= power[0];
  }
  if (power) for (int i = n; i < d; i++) power[1] -= v[i] * (dot(at->V + i * links, w->inertial, links) + dot(at->Z + i * c, w->given, c));
  return isfinite(size_of(w->ddq, c)) ? MGK_OK : MGK_NOT_FINITE;
}

/* u' of the first n drives at a state x in w, increments counted from x0. */
static void rates_of_increments(const Model *m, Work *w, Motion *at, int n, const double *x0, const double *x, double *out) {
  double *y = at->off, *moved = at->off + m->columns;
  difference(m, x, x0, y);
  tangent(m, y, w->dq, moved, NULL);
  FOR(k, n) out[k] = moved[m->drive[k]];
}

/* --- an integrator ----------------------------------------------------------------------------------------------------------------- */

static const double RELATIVE = 1e-9, ABSOLUTE = 1e-10; /* error of a step, radians and lengths / L, and their rates */
static const double SHORTEST_STEP = 1e-12;             /* part of the time below which a step is rounding */
enum { MOST_STEPS_OF_MOTION = 100000 };

static const double NODE[STAGES] = {0.0, 0.2, 0.3, 0.8, 8.0 / 9, 1.0, 1.0};
static const double STAGE[STAGES][STAGES - 1] = {
  {0.0},
  {1.0 / 5},
  {3.0 / 40, 9.0 / 40},
  {44.0 / 45, -56.0 / 15, 32.0 / 9},
  {19372.0 / 6561, -25360.0 / 2187, 64448.0 / 6561, -212.0 / 729},
  {9017.0 / 3168, -355.0 / 33, 46732.0 / 5247, 49.0 / 176, -5103.0 / 18656},
  {35.0 / 384, 0.0, 500.0 / 1113, 125.0 / 192, -2187.0 / 6784, 11.0 / 84},
};
static const double LEFT_OUT[STAGES] = {71.0 / 57600, 0.0, -71.0 / 16695, 71.0 / 1920, -17253.0 / 339200, 22.0 / 525, -1.0 / 40};

/* Freedoms chosen to be independent, by pivots among the motions Z, which are used up: with them all others move at like rates. */
static void chosen(const Model *m, Motion *at) {
  const int d = m->drives, c = m->columns;
  FOR(i, c) at->place[i] = 0;
  FOR(k, d) {
    int best = 0;
    double most = -1.0;
    FOR(i, c) if (!at->place[i]) {
      double size = 0.0;
      FOR(j, d) size += at->Z[j * c + i] * at->Z[j * c + i];
      if (size > most) most = size, best = i;
    }
    at->place[best] = 1, at->drive[k] = best;
    FOR(j, d) at->a[j] = at->Z[j * c + best] / sqrt(most);
    FOR(i, c) {
      double part = 0.0;
      FOR(j, d) part += at->a[j] * at->Z[j * c + i];
      FOR(j, d) at->Z[j * c + i] -= part * at->a[j];
    }
  }
  int unknowns = 0;
  FOR(i, c) {
    if (at->place[i]) at->place[i] = -1;
    else at->unknown[unknowns] = i, at->place[i] = unknowns++;
  }
}

/* Slopes of u and v at y = (u, v), a time h behind the begin of a step; the state in at->guess. */
static int slope_of(const Model *m, Work *w, Motion *at, const double *y, double h, double *out) {
  const int d = m->drives;
  FOR(c, m->columns) w->increment[c] = h * (at->speed[c] + 0.5 * h * at->speed[m->columns + c]);
  advance(m, at->begin, w->increment, at->guess);
  int status = closed_at(m, w, at, d, at->begin, y, NULL, at->guess);
  if (!status) status = accelerations(m, w, at, d, at->guess, y + d, NULL, 0, NULL, NULL, NULL);
  if (status) return status;
  rates_of_increments(m, w, at, d, at->begin, at->guess, out);
  memcpy(out + d, at->a, d * sizeof(double));
  return MGK_OK;
}

/* Accelerations at the kept state with its rates, in freedoms chosen there: the first slope of a step, in w everything at that state. */
static int begun_step(const Model *m, Work *w, Motion *at) {
  const int d = m->drives;
  memcpy(at->begin, w->x, m->states * sizeof(double));
  memset(at->y, 0, d * sizeof(double));
  memset(at->speed, 0, 2 * m->columns * sizeof(double));
  FOR(pass, 2) {
    FOR(k, d) at->y[d + k] = at->rate[m->drive[k]];
    const int status = slope_of(m, w, at, at->y, 0.0, at->slope);
    if (status) return status;
    if (!pass) chosen(m, at);
  }
  memcpy(at->speed, w->dq, m->columns * sizeof(double));
  memcpy(at->speed + m->columns, w->ddq, m->columns * sizeof(double));
  return MGK_OK;
}

/* A step of length h by the method of Dormand and Prince; `off`: its error over what is allowed. */
static int tried(const Model *m, Work *w, Motion *at, double h, double *off) {
  const int n = 2 * m->drives;
  double *y = at->y + n;
  for (int s = 1; s < STAGES; s++) {
    FOR(i, n) {
      double sum = 0.0;
      FOR(j, s) sum += STAGE[s][j] * at->slope[j * n + i];
      y[i] = at->y[i] + h * sum;
    }
    const int status = slope_of(m, w, at, y, NODE[s] * h, at->slope + s * n);
    if (status) return status;
  }
  *off = 0.0;
  FOR(i, n) {
    double sum = 0.0;
    FOR(s, STAGES) sum += LEFT_OUT[s] * at->slope[s * n + i];
    *off = fmax(*off, fabs(h * sum) / (ABSOLUTE + RELATIVE * fmax(fabs(at->y[i]), fabs(y[i]))));
  }
  return isfinite(*off) ? MGK_OK : MGK_NOT_FINITE;
}

/* The motion followed for a time. */
static int followed(const Model *m, Work *w, Motion *at, double time) {
  double done = 0.0, off = 0.0;
  int steps = 0;
  while (done < time) {
    int status = begun_step(m, w, at);
    if (status) return status;
    for (;;) {
      if (++steps > MOST_STEPS_OF_MOTION) return MGK_TOO_FAR;
      const double left = time - done, h = *at->step > 0.0 && *at->step < left ? *at->step : left;
      if (!(h > SHORTEST_STEP * time)) return status ? status : MGK_STEP;
      status = tried(m, w, at, h, &off);
      const double grown = status ? 0.25 : fmin(5.0, fmax(0.2, 0.9 * pow(fmax(off, 1e-10), -0.2)));
      if (status || off > 1.0 || h < left) *at->step = grown * h;
      if (status || off > 1.0) continue;
      done = h < left ? done + h : time;
      memcpy(w->x, at->guess, m->states * sizeof(double));
      memcpy(at->rate, w->dq, m->columns * sizeof(double));
      coordinates(m, w, w->x, w->column_value); /* rotation vectors are continued */
      break;
    }
  }
  return MGK_OK;
}

static void opened_motion(const int *I, const double *P, void *state, Model *m, Work *w, Motion *at) {
  opened(I, P, state, m, w);
  lay_out_motion(m, I[MGK_LOAD_NUMBERS], (double *)state + mgk_state_size(I) / sizeof(double), at);
}

size_t mgk_motion_size(const int *I) {
  Model m;
  Motion at;
  read_tables(I, NULL, &m);
  return mgk_state_size(I) + lay_out_motion(&m, I[MGK_LOAD_NUMBERS], NULL, &at);
}

/* Begin at the start of P with rates v of the drives, at rest where it is NULL. */
int mgk_motion_start(const int *I, const double *P, void *state, const double *v) {
  Model m;
  Work w;
  Motion at;
  int status = mgk_start(I, P, state);
  if (status) return status;
  opened_motion(I, P, state, &m, &w, &at);
  memcpy(at.drive, m.drive, m.drives * sizeof(int)), memcpy(at.unknown, m.unknown, m.unknowns * sizeof(int));
  memcpy(at.place, m.place, m.columns * sizeof(int));
  memcpy(at.begin, w.x, m.states * sizeof(double));
  *at.step = 0.0;
  memset(at.y, 0, m.drives * sizeof(double));
  FOR(i, m.drives) at.y[m.drives + i] = v ? v[i] / (m.is_length[m.drive[i]] ? *m.unit : 1.0) : 0.0;
  status = closed_at(&m, &w, &at, m.drives, at.begin, at.y, NULL, w.x);
  if (!status && completed(&m, &w, at.y + m.drives, NULL, 0.0, at.rate) > INDEPENDENT) status = MGK_CONTRADICTION;
  return status;
}

/* On by a time under efforts of the drives, which are held: position and velocity [columns], reaction[6 pairs], as of mgk_solve; any may be
 * NULL. Unless 0 is returned the state stays where it was. */
int mgk_advance(const int *I, const double *P, void *state, double time, const double *effort, double *position, double *velocity,
                double *reaction) {
  Model m;
  Work w;
  Motion at;
  int places[MGK_PARTS + 1];
  magnitude largest[2] = {0.0, 0.0};
  if (!(time >= 0.0) || !isfinite(time)) return MGK_NOT_FINITE;
  FOR(i, I[MGK_DRIVES]) if (!isfinite(effort[i])) return MGK_NOT_FINITE;
  opened_motion(I, P, state, &m, &w, &at);
  mgk_record(I, places);
  const int d = m.drives, numbers = I[MGK_LOAD_NUMBERS], *declared = m.drive;
  const double L = *m.unit;
  memcpy(at.load_number, m.load_number, numbers * sizeof(double));
  FOR(i, d) at.load_number[numbers - d + i] = effort[i] / (m.is_length[declared[i]] ? L : L * L);
  m.load_number = at.load_number, m.drive = at.drive, m.unknown = at.unknown, m.place = at.place;
  memcpy(w.kept, w.x, w.n_kept * sizeof(double)), memcpy(at.kept, at.rate, at.n_kept * sizeof(double));
  int status = followed(&m, &w, &at, time);
  if (!status) status = begun_step(&m, &w, &at);
  if (!status) {
    memcpy(w.trial, at.guess, m.states * sizeof(double));
    status = rates(&m, &w, at.y + d, at.slope + d);
  }
  if (!status) status = forces(&m, &w, w.trial, w.record, places, largest);
  if (status) {
    memcpy(w.x, w.kept, w.n_kept * sizeof(double)), memcpy(at.rate, at.kept, at.n_kept * sizeof(double));
    return status;
  }
  if (position) coordinates(&m, &w, w.x, position);
  if (velocity) FOR(c, m.columns) velocity[c] = w.dq[c] * (m.is_length[c] ? L : 1.0);
  if (reaction) FOR(k, m.pairs) given_out(&m, w.record, places, k, reaction + 6 * k);
  FOR(i, d) w.drive[i] = w.x[m.column_state[declared[i]]];
  return MGK_OK;
}

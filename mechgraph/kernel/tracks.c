/* Tracks of synthesis (synthesis/legs.py) and of assemblies (modes/homotopy.py), one after the other, in complex numbers: the closure at all
 * rows of a task with unknown dimensions, eliminated row by row; of assemblies there is one row and no unknown. A row is a state of the
 * mechanism; its equations are those of loops and couplings and, behind them, of rods (d^2 - l^2) / 2 (synthesis/rods.py). The state of a
 * track: unknowns, norms of directions where any are unknown, then all rows. Part of derivative.c; of calls.c, in real numbers, mgk_rows and
 * what it needs.
 *
 * A   rows, unknowns, head, states of a row, pairs with those of rods, rods, moved, asked, then one after the other:
 *       side[links]                             the pose among identity, markers A and markers B in which a link stands
 *       place[5 moved]                          what grows with an unknown: its number; array (point, axis, second), component, side and pair
 *       end[6 rods]                             of both ends of a rod the pair, the side on which the rod has it, and the body beyond
 *       square[rods]                            where the square of its length stands among what is asked (-1: that of what is on the rod)
 *       way[rods pairs], through[loops pairs]   how a rod and a loop pass the pairs
 *       column[asked], factor[asked]            what is asked (-1: a square), and the unknown that is its factor (-1: none)
 *       given[rows asked]                       whether it is asked of a row
 *       of every row: rank, settled, free, whether it is mixed, its free columns
 * leg: numbers of the markers at the begin of a way [3 arrays][3][2][pairs], the screws on which they go [6][2][pairs], and how they change
 * beside that [3][3][2][pairs]; what is asked at the begin, and how that changes, [rows][asked]. All arrays run with ways, or tracks, last.
 */

typedef struct {
  int rows, unknowns, head, states, pairs, rods, moved, asked;
  const int *side, *place, *end, *square, *way, *through, *column, *factor, *given, *row;
} Arrow;

static void read_arrow(const Model *m, const int *A, Arrow *a) {
  a->rows = A[0], a->unknowns = A[1], a->head = A[2], a->states = A[3], a->pairs = A[4], a->rods = A[5], a->moved = A[6], a->asked = A[7];
  const int *i = A + 8;
  a->side = i, i += m->links, a->place = i, i += 5 * a->moved, a->end = i, i += 6 * a->rods, a->square = i, i += a->rods;
  a->way = i, i += a->rods * m->pairs, a->through = i, i += m->loops * m->pairs;
  a->column = i, i += a->asked, a->factor = i, i += a->asked, a->given = i, i += a->rows * a->asked, a->row = i;
}

static double square_of(number x) { return creal(x) * creal(x) + cimag(x) * cimag(x); }

/* x[n][k] = S[n][n]^-1 x of rows [n][n + k], by pivots. */
static void solved_rows(int n, int k, number *S) {
  const int w = n + k;
  FOR(j, n) {
    int best = j;
    for (int r = j + 1; r < n; r++) if (square_of(S[r * w + j]) > square_of(S[best * w + j])) best = r;
    if (best != j) FOR(c, w) {
      const number value = S[j * w + c];
      S[j * w + c] = S[best * w + c], S[best * w + c] = value;
    }
    const number unit = 1.0 / S[j * w + j];
    for (int r = j + 1; r < n; r++) {
      const number part = S[r * w + j] * unit;
      for (int c = j + 1; c < w; c++) S[r * w + c] -= part * S[j * w + c];
    }
  }
  for (int i = n - 1; i >= 0; i--) FOR(c, k) {
    number *x = S + n + c;
    for (int j = i + 1; j < n; j++) x[i * w] -= S[i * w + j] * x[j * w];
    x[i * w] /= S[i * w + i];
  }
}

typedef struct {
  Model m;
  Arrow a;
  Work w;
  number *P, *own, *pose, *marker, *numbers, *rates, *norm, *drive, *change, *J, *raw, *reduced, *S, *small, *line, *x, *moved, *step, *eta;
  int *order, *leads, height, wide, size;
} Track;

/* Memory of a track, its size in numbers. */
static size_t lay_out_track(Track *t, int numbers, number *memory) {
  const Model *m = &t->m;
  const int c = m->columns, f = t->wide, h = t->height, p = t->a.pairs;
  size_t size = 0;
#define TAKE(name, count) name = taken(&memory, &size, (count))
  TAKE(t->P, numbers), TAKE(t->own, 12 * m->links), TAKE(t->pose, 12 * m->links), TAKE(t->marker, 24 * p), TAKE(t->numbers, 18 * p), TAKE(t->rates, 18 * p);
  TAKE(t->norm, 4 * p), TAKE(t->drive, t->a.rows * t->a.asked), TAKE(t->change, t->a.rows * t->a.asked);
  TAKE(t->w.pose, 12 * m->links), TAKE(t->w.frame, 12 * m->factors), TAKE(t->w.end, 12 * m->pairs), TAKE(t->w.S, 6 * c), TAKE(t->w.residual, m->rows);
  TAKE(t->w.middle, 3 * m->loops), TAKE(t->J, h * c), TAKE(t->raw, h * f), TAKE(t->reduced, t->a.rows * h * f), TAKE(t->S, t->a.unknowns * (t->a.unknowns + 2));
  TAKE(t->small, 2 * c * c + 4 * c + 3 * h + f), TAKE(t->line, 12 * t->a.rods), TAKE(t->x, t->size), TAKE(t->moved, t->size), TAKE(t->step, 2 * (t->a.head + t->a.rows * c)), TAKE(t->eta, 6 * (t->a.moved + 2 * p));
  t->order = (int *)taken(&memory, &size, t->a.rows * c), t->leads = (int *)taken(&memory, &size, 2 * p);
#undef TAKE
  return size;
}

static void open_track(const int *I, const double *P, const int *A, int numbers, number *memory, Track *t) {
  read_tables(I, memory, &t->m);
  read_arrow(&t->m, A, &t->a);
  t->height = t->m.rows + t->a.rods, t->wide = t->m.columns + t->a.unknowns + 2, t->size = t->a.head + t->a.rows * t->a.states;
  lay_out_track(t, numbers, memory);
  FOR(i, memory ? numbers : 0) t->P[i] = P[i];
  t->w.evaluations = 0;
}

/* --- the member on the way ---------------------------------------------------------------------------------------------------------- */

/* Points and directions v[3 arrays] moved along the screw `at` eta. */
static void screwed(const number *eta, number at, number *v) {
  number w[3], u[3], way[3], part[3], more[3];
  FOR(r, 3) w[r] = at * eta[r], u[r] = at * eta[3 + r];
  const number square = dot(w, w, 3), angle = sqrt(square);
  const int small = cabs(angle) < 1e-4;
  const number s = small ? 1.0 - square / 6.0 : sin(angle) / angle, a = small ? 0.5 - square / 24.0 : (1.0 - cos(angle)) / square;
  const number b = small ? 1.0 / 6.0 - square / 120.0 : (1.0 - s) / square;
  FOR(i, 3) {
    number *q = v + 3 * i;
    cross(w, q, part), cross(w, part, more);
    FOR(r, 3) q[r] += s * part[r] + a * more[r];
  }
  cross(w, u, part), cross(w, part, way);
  FOR(r, 3) v[r] += u[r] + a * part[r] + b * way[r];
}

/* The numbers of the markers and what is asked at `at` of a way, and their rates. */
static void put_on_way(Track *t, const number *const *leg, size_t ways, size_t way, number at) {
  const int p = t->a.pairs, n = t->a.rows * t->a.asked;
  FOR(i, 2 * p) {
    number *v = t->numbers + 9 * i, *d = t->rates + 9 * i, eta[6];
    double moves = 0.0;
    FOR(j, 9) v[j] = leg[0][((size_t)j * 2 * p + i) * ways + way], d[j] = leg[2][((size_t)j * 2 * p + i) * ways + way];
    FOR(j, 6) eta[j] = leg[1][((size_t)j * 2 * p + i) * ways + way], moves += square_of(eta[j]);
    if (moves > 0.0) screwed(eta, at, v);
    FOR(j, 3) {
      number turn[3];
      cross(eta, v + 3 * j, turn);
      FOR(r, 3) v[3 * j + r] += at * d[3 * j + r], d[3 * j + r] += turn[r] + (j ? 0.0 : eta[3 + r]);
    }
  }
  FOR(j, n) t->change[j] = leg[4][j * ways + way], t->drive[j] = leg[3][j * ways + way] + at * t->change[j];
}

/* The norm of a direction, of the sign nearest to another one where that is given. */
static number norm_of(const number *v, const number *near) {
  const number size = sqrt(dot(v, v, 3));
  return near && cabs(size - *near) > cabs(size + *near) ? -size : size;
}

/* What is left of a second direction across a unit axis z. */
static void left_across(const number *second, const number *z, number *out) {
  const number along = dot(z, second, 3);
  FOR(r, 3) out[r] = second[r] - along * z[r];
}

/* Unknowns of a state x put in their places, which are not led by anything else; norms, those of x going on; markers of the mechanism. */
static void put_unknowns(Track *t, number *x) {
  const Model *m = &t->m;
  const int p = t->a.pairs;
  number *own[2] = {(number *)m->marker_a, (number *)m->marker_b}, *norms = t->a.head > t->a.unknowns ? x + t->a.unknowns : NULL;
  FOR(j, t->a.moved) {
    const int *at = t->a.place + 5 * j, i = 9 * (at[3] * p + at[4]) + 3 * at[1] + at[2];
    t->numbers[i] = x[at[0]], t->rates[i] = 0.0;
  }
  FOR(i, 2 * p) {
    const number *v = t->numbers + 9 * i;
    number *X = t->marker + 12 * i, z[3], e[3], y[3];
    t->norm[i] = norm_of(v + 3, norms ? norms + i : NULL);
    FOR(r, 3) z[r] = v[3 + r] / t->norm[i];
    left_across(v + 6, z, e);
    t->norm[2 * p + i] = norm_of(e, norms ? norms + 2 * p + i : NULL);
    FOR(r, 3) e[r] /= t->norm[2 * p + i];
    cross(z, e, y);
    FOR(r, 3) X[4 * r] = e[r], X[4 * r + 1] = y[r], X[4 * r + 2] = z[r], X[4 * r + 3] = v[r];
  }
  if (norms) memcpy(norms, t->norm, 4 * p * sizeof(number));
  /* every link has the frame of its pair in the tree */
  FOR(i, m->links) {
    number *X = t->own + 12 * i;
    const int at = t->a.side[i] - 1, side = at >= m->pairs;
    FOR(r, 3) FOR(c, 4) X[4 * r + c] = r == c;
    if (at < 0) continue;
    const number *M = t->marker + 12 * (side * p + at - side * m->pairs);
    FOR(r, 3) {
      FOR(c, 3) X[4 * r + c] = M[4 * c + r];
      FOR(c, 3) X[4 * r + 3] -= X[4 * r + c] * M[4 * c + 3];
    }
  }
  FOR(side, 2) FOR(k, m->pairs) product(t->own + 12 * m->ends[2 * k + side], t->marker + 12 * (side * p + k), own[side] + 12 * k);
  FOR(i, t->a.rows) FOR(j, t->a.asked) {
    const int at = i * t->a.asked + j, state = t->a.column[j] < 0 ? -1 : m->column_state[t->a.column[j]];
    if (state >= 0 && t->a.given[at]) x[t->a.head + i * t->a.states + state] = t->drive[at] * (t->a.factor[j] < 0 ? 1.0 : x[t->a.factor[j]]);
  }
}

/* The twist of a marker, in the frame of its link, for rates d of its numbers (unknowns.marker_twists): w = (x x x' + y x y' + z x z') / 2;
 * of a rod the rate of its point. */
static void marker_twist(const Track *t, int i, const number *d, number *out) {
  const number *v = t->numbers + 9 * i, *X = t->marker + 12 * i;
  const number e[3] = {X[0], X[4], X[8]}, y[3] = {X[1], X[5], X[9]}, z[3] = {X[2], X[6], X[10]}, *second = v + 6;
  number de[3], dy[3], dz[3], part[3];
  double turns = 0.0;
  FOR(r, 3) out[r] = 0.0, out[3 + r] = d[r], turns += square_of(d[3 + r]) + square_of(d[6 + r]);
  if (turns == 0.0 || i % t->a.pairs >= t->m.pairs) return;
  const number along = dot(z, second, 3), grown = dot(z, d + 3, 3);
  FOR(r, 3) dz[r] = (d[3 + r] - z[r] * grown) / t->norm[i];
  const number turned_in = dot(dz, second, 3) + dot(z, d + 6, 3);
  FOR(r, 3) de[r] = d[6 + r] - turned_in * z[r] - along * dz[r];
  const number longer = dot(e, de, 3);
  FOR(r, 3) de[r] = (de[r] - e[r] * longer) / t->norm[2 * t->a.pairs + i];
  cross(dz, e, dy), cross(z, de, part);
  FOR(r, 3) dy[r] += part[r];
  const number *axes[3] = {e, y, z}, *rates[3] = {de, dy, dz};
  FOR(j, 3) {
    cross(axes[j], rates[j], part);
    FOR(r, 3) out[r] += 0.5 * part[r];
  }
  cross(v, out, part);
  FOR(r, 3) out[3 + r] += part[r];
}

/* How all markers move, those that unknowns place and those that are led. */
static void put_twists(Track *t) {
  FOR(j, t->a.moved) {
    const int *place = t->a.place + 5 * j;
    number unit[9] = {0.0};
    unit[3 * place[1] + place[2]] = 1.0;
    marker_twist(t, place[3] * t->a.pairs + place[4], unit, t->eta + 6 * j);
  }
  FOR(i, 2 * t->a.pairs) {
    double moves = 0.0;
    FOR(r, 9) moves += square_of(t->rates[9 * i + r]);
    if ((t->leads[i] = !(moves == 0.0))) marker_twist(t, i, t->rates + 9 * i, t->eta + 6 * (t->a.moved + i));
  }
}

/* --- the equations ------------------------------------------------------------------------------------------------------------------- */

/* The rods at a state: what they leave open, and their lines W = (p_b x d, d), with the way between their points on them, and their rows of J. */
static void put_rods(Track *t, int row, number *open) {
  const Model *m = &t->m;
  const int p = t->a.pairs;
  FOR(i, t->a.rods) {
    const int *near = t->a.end + 6 * i, *far = near + 3;
    const number *point[4];
    number a[3], b[3], *W = t->line + 12 * i, sum = 0.0;
    FOR(e, 4) point[e] = t->numbers + 9 * ((e % 2 ? 1 - near[e / 2 * 3 + 1] : near[e / 2 * 3 + 1]) * p + near[e / 2 * 3]);
    point_of(t->pose + 12 * near[2], point[1], a), point_of(t->pose + 12 * far[2], point[3], b);
    FOR(r, 3) {
      const number e = (b[r] - point[2][r]) - (a[r] - point[0][r]);
      W[3 + r] = b[r] - a[r], W[6 + r] = point[2][r] - point[0][r];
      sum += e * (2.0 * W[3 + r] - e);
    }
    cross(b, W + 3, W);
    if (t->a.square[i] >= 0) sum = dot(W + 3, W + 3, 3) - t->drive[row * t->a.asked + t->a.square[i]];
    open[i] = 0.5 * sum;
    FOR(c, m->columns) {
      const int way = t->a.way[i * m->pairs + m->owner[c]];
      t->J[(m->rows + i) * m->columns + c] = way ? way * dot(W, t->w.S + 6 * c, 6) : 0.0;
    }
  }
}

/* How fast loops and rods open where a marker moves by the twist `own` in the frame of its link; a point of a rod alone. */
static void opened_by(const Track *t, int side, int pair, const number *own, number *out) {
  const Model *m = &t->m;
  number V[6], s[6];
  FOR(r, t->height) out[r] = 0.0;
  if (pair < m->pairs) {
    const number *X = t->pose + 12 * m->ends[2 * pair + side], at[3] = {X[3], X[7], X[11]};
    const double sense = side ? -1.0 : 1.0;
    turned(X, own, V), turned(X, own + 3, V + 3);
    cross(at, V, s);
    FOR(r, 3) V[3 + r] += s[r];
    FOR(l, m->loops) if (t->a.through[l * m->pairs + pair]) {
      twist_about(V, t->w.middle + 3 * l, s);
      FOR(r, m->height) out[m->height * l + r] = sense * t->a.through[l * m->pairs + pair] * s[m->part + r];
    }
    FOR(i, t->a.rods) if (t->a.way[i * m->pairs + pair]) out[m->rows + i] = sense * t->a.way[i * m->pairs + pair] * dot(t->line + 12 * i, V, 6);
    return;
  }
  FOR(i, t->a.rods) FOR(e, 2) {
    const int *end = t->a.end + 6 * i + 3 * e;
    const number *W = t->line + 12 * i;
    if (end[0] != pair) continue;
    turned_back(t->pose + 12 * end[2], W + 3, V);
    FOR(r, 3) if (side == end[1]) V[r] = -W[6 + r];
    out[m->rows + i] = (e ? 1.0 : -1.0) * dot(V, own + 3, 3);
  }
}

/* The equations of row i, of which `row` tells the free columns, at a state: M[height][free + unknowns + sides], behind the derivatives what
 * they leave open with the other sign and, with two `sides`, how fast they close along the way. The largest number in a pose of a link, squared. */
static double put_row(Track *t, int i, const int *row, const number *x, number *M, int sides) {
  const Model *m = &t->m;
  const Arrow *a = &t->a;
  const int c = m->columns, h = t->height, u = a->unknowns, free = row[2], *columns = row + 4, w = free + u + sides, last = free + u + 1;
  number *open = t->small, *column = t->small;
  double size = 0.0;
  evaluate(m, &t->w, x + a->head + i * a->states);
  FOR(l, m->links) {
    product(t->w.pose + 12 * l, t->own + 12 * l, t->pose + 12 * l);
    FOR(j, 12) size = raised(size, square_of(t->pose[12 * l + j]));
  }
  fill(m, t->w.S, t->w.middle, NULL, NULL, t->J);
  put_rods(t, i, open);
  FOR(r, h) {
    FOR(j, free) M[r * w + j] = t->J[r * c + columns[j]];
    FOR(j, u) M[r * w + free + j] = 0.0;
    M[r * w + free + u] = r < m->rows ? -t->w.residual[r] : -open[r - m->rows];
    if (sides > 1) M[r * w + last] = 0.0;
  }
  FOR(j, sides > 1 ? a->rods : 0) if (a->square[j] >= 0) M[(m->rows + j) * w + last] = 0.5 * t->change[i * a->asked + a->square[j]];
  FOR(j, a->moved) {
    const int *place = a->place + 5 * j;
    opened_by(t, place[3], place[4], t->eta + 6 * j, column);
    FOR(r, h) M[r * w + free + place[0]] += column[r];
  }
  FOR(j, a->asked) if (a->column[j] >= 0 && a->given[i * a->asked + j]) {
    const int place = i * a->asked + j, factor = a->factor[j];
    FOR(r, h) {
      const number own = t->J[r * c + a->column[j]];
      if (factor >= 0) M[r * w + free + factor] += own * t->drive[place];
      if (sides > 1) M[r * w + last] -= own * t->change[place] * (factor < 0 ? 1.0 : x[factor]);
    }
  }
  FOR(j, sides > 1 ? 2 * a->pairs : 0) if (t->leads[j]) {
    opened_by(t, j / a->pairs, j % a->pairs, t->eta + 6 * (a->moved + j), column);
    FOR(r, h) M[r * w + last] -= column[r];
  }
  return size;
}

/* --- states --------------------------------------------------------------------------------------------------------------------------- */

static void advance_track(const Track *t, number *x, const number *dq) {
  FOR(j, t->a.head) x[j] += dq[j];
  FOR(i, t->a.rows) advance(&t->m, x + t->a.head + i * t->a.states, dq + t->a.head + i * t->m.columns, x + t->a.head + i * t->a.states);
}

#ifndef MGK_COMPLEX
/* --- rows of fits ------------------------------------------------------------------------------------------------------------------ */

/* Loops of equations M[.][w], as they are filled in, taken about the middles of their pairs. */
static void about_middles(const Track *t, int w, number *M) {
  const Model *m = &t->m;
  FOR(l, m->loops) {
    const int first = m->loop_first[l], steps = m->loop_first[l + 1] - first;
    number way[3], s[6];
    FOR(r, 3) way[r] = -t->w.middle[3 * l + r];
    FOR(i, steps) {
      const int k = m->loop_pair[first + i];
      const number *X = m->marker_b + 12 * k, own[3] = {X[3], X[7], X[11]};
      point_of(t->w.pose + 12 * m->ends[2 * k + 1], own, s);
      FOR(r, 3) way[r] += s[r] / steps;
    }
    FOR(c, w) {
      number V[6] = {0.0};
      FOR(r, m->height) V[m->part + r] = M[(m->height * l + r) * w + c];
      twist_about(V, way, s);
      FOR(r, m->height) M[(m->height * l + r) * w + c] = s[m->part + r];
    }
  }
}

/* The one row at real states x[tracks][state], closed by Newton's method in as many coordinates, the first ones of it, as there are equations:
 * until it is open by less than `to`, the first step below the `longest` and each at most half as long as the one before; whether it came there.
 * Its equations rows[tracks][height][free + unknowns + 1] as of put_row. */
void mgk_rows(const int *I, const double *P, int numbers, const int *A, const number *const *leg, int tracks, double longest, double to, double *x,
              double *rows, int *came, number *memory) {
  Track t;
  open_track(I, P, A, numbers, memory, &t);
  const int h = t.height, moved = t.a.moved, *columns = t.a.row + 4, w = t.a.row[2] + t.a.unknowns + 1, length = t.a.head + t.m.columns;
  number *S = t.reduced;
  put_on_way(&t, leg, 1, 0, 0.0);
  FOR(k, tracks) {
    double *own = x + (size_t)k * t.size, last = 2.0 * longest;
    int known = k > 0;
    FOR(j, t.a.unknowns) known &= own[j] == own[j - t.size];
    FOR(j, t.size) t.x[j] = own[j];
    if (!known) put_unknowns(&t, t.x), put_twists(&t);
    came[k] = 0, t.a.moved = 0;
    FOR(trial, 12) {
      double open = 0.0, step = 0.0;
      put_row(&t, 0, t.a.row, t.x, t.raw, 1);
      FOR(r, h) open = raised(open, cabs(t.raw[r * w + w - 1]));
      if ((came[k] = last < 1e-8 || open < to)) break;
      FOR(r, h) FOR(c, h + 1) S[r * (h + 1) + c] = t.raw[r * w + (c < h ? c : w - 1)];
      solved_rows(h, 1, S);
      FOR(j, length) t.step[j] = 0.0;
      FOR(r, h) t.step[t.a.head + columns[r]] = S[r * (h + 1) + h], step = raised(step, cabs(S[r * (h + 1) + h]));
      if (!(step < 0.5 * last)) break;
      advance_track(&t, t.x, t.step), last = step;
    }
    t.a.moved = moved;
    put_row(&t, 0, t.a.row, t.x, t.raw, 1), about_middles(&t, w, t.raw);
    FOR(j, t.size) own[j] = creal(t.x[j]);
    FOR(j, h * w) rows[(size_t)k * h * w + j] = creal(t.raw[j]);
  }
}

#else
/* --- tracks ------------------------------------------------------------------------------------------------------------------------ */

/* Numbers of memory, complex ones, for mgk_tracks. */
size_t mgk_tracks_size(const int *I, const int *A, int numbers) {
  Track t;
  open_track(I, NULL, A, numbers, NULL, &t);
  return lay_out_track(&t, numbers, NULL);
}

/* Reflections that make the first `k` columns of M[n][w] triangular; of `order`, where it is given, the largest of the first f columns come
 * first. Right sides are among the columns. v[n], s[w] are room. */
static void reflected(int n, int w, int f, int k, number *M, int *order, number *v, number *s) {
  FOR(j, k) {
    if (order) {
      int best = j;
      double most = -1.0;
      for (int c = j; c < f; c++) {
        double size = 0.0;
        for (int r = j; r < n; r++) size += square_of(M[r * w + c]);
        if (size > most) most = size, best = c;
      }
      if (best != j) {
        const int kept = order[j];
        order[j] = order[best], order[best] = kept;
        FOR(r, n) {
          const number value = M[r * w + j];
          M[r * w + j] = M[r * w + best], M[r * w + best] = value;
        }
      }
    }
    double size = 0.0;
    for (int r = j; r < n; r++) v[r] = M[r * w + j], size += square_of(v[r]);
    if (j == n - 1) continue;
    const double long_side = sqrt(size), first = cabs(v[j]);
    if (size < 1e-280) continue; /* none but what was left of numbers near the smallest */
    v[j] += first > 1e-140 ? v[j] * (long_side / first) : long_side;
    const double part = 1.0 / (size + long_side * first);
    FOR(c, w - j) s[c] = 0.0;
    for (int r = j; r < n; r++) {
      const number by = conj(v[r]);
      FOR(c, w - j) s[c] += by * M[r * w + j + c];
    }
    for (int r = j; r < n; r++) {
      const number by = part * v[r];
      FOR(c, w - j) M[r * w + j + c] -= by * s[c];
    }
  }
}

/* The least y[f] with the first n rows of M[.][w], triangular, times y = b[n]; `order` of its columns. Room: W[f][n + f], v[f], s[n + f]. */
static void least(int n, int f, int w, const number *M, const int *order, const number *b, number *y, number *W, number *v, number *s) {
  if (n == f) {
    for (int i = n - 1; i >= 0; i--) {
      number sum = b[i];
      for (int j = i + 1; j < n; j++) sum -= M[i * w + j] * y[j];
      y[i] = sum / M[i * w + i];
    }
    return;
  }
  /* across the rows: M^* = Q R, y = Q R^-* b, of which Q is undone by the reflections of [M^* | I] */
  const int wide = n + f;
  FOR(r, f) FOR(c, wide) W[r * wide + c] = c < n ? (c <= r ? conj(M[c * w + r]) : 0.0) : r == c - n;
  reflected(f, wide, n, n, W, NULL, v, s);
  number *z = s;
  FOR(i, n) {
    z[i] = b[i];
    FOR(j, i) z[i] -= conj(W[j * wide + i]) * z[j];
    z[i] /= conj(W[i * wide + i]);
  }
  FOR(c, f) {
    number sum = 0.0;
    FOR(i, n) sum += conj(W[i * wide + n + c]) * z[i];
    y[order[c]] = sum;
  }
}

/* At a state x, in which unknowns and what is asked are put, the step of Newton's method, and with two `sides` the rates along the way behind
 * it: t->step[sides][head + rows columns]. The largest number in a pose of a link. */
static double linearized(Track *t, number *x, const number *mixing, int sides) {
  const Model *m = &t->m;
  const Arrow *a = &t->a;
  const int c = m->columns, h = t->height, u = a->unknowns, length = a->head + a->rows * c;
  const int *row = a->row;
  double size = 0.0;
  int at = 0;
  put_unknowns(t, x), put_twists(t);
  FOR(i, a->rows) {
    const int rank = row[0], settled = row[1], free = row[2], mixed = row[3], *columns = row + 4, w = free + u + sides;
    number *out = t->reduced + (size_t)i * h * t->wide, *M = mixed ? t->raw : out;
    size = raised(size, put_row(t, i, row, x, M, sides));
    if (mixed) {
      memset(out, 0, (size_t)rank * w * sizeof(number));
      FOR(r, rank) FOR(j, h) {
        const number part = mixing[r * h + j];
        FOR(l, w) out[r * w + l] += part * M[j * w + l];
      }
      mixing += (size_t)rank * h;
    }
    int *order = t->order + i * c;
    FOR(j, free) order[j] = j;
    reflected(rank, w, free, settled, out, settled < free ? order : NULL, t->small, t->small + h);
    FOR(r, rank - settled) FOR(j, u + sides) t->S[(at + r) * (u + sides) + j] = out[(settled + r) * w + free + j];
    at += rank - settled, row = columns + free;
  }
  solved_rows(u, sides, t->S);
  FOR(j, sides * length) t->step[j] = 0.0;
  FOR(side, sides) FOR(j, u) t->step[side * length + j] = t->S[j * (u + sides) + u + side];
  row = a->row;
  FOR(i, a->rows) {
    const int settled = row[1], free = row[2], *columns = row + 4, w = free + u + sides;
    const number *M = t->reduced + (size_t)i * h * t->wide;
    number *b = t->small, *y = b + h, *v = y + c, *s = v + c;
    FOR(side, sides) {
      number *to = t->step + side * length;
      FOR(r, settled) {
        b[r] = M[r * w + free + u + side];
        FOR(j, u) b[r] -= M[r * w + free + j] * to[j];
      }
      least(settled, free, w, M, t->order + i * c, b, y, s + 2 * c, v, s);
      FOR(j, free) to[a->head + i * c + columns[j]] = y[j];
      FOR(j, side ? a->asked : 0) if (a->column[j] >= 0 && a->given[i * a->asked + j]) {
        const int place = i * a->asked + j, factor = a->factor[j];
        to[a->head + i * c + a->column[j]] = factor < 0 ? t->change[place] : t->change[place] * x[factor] + t->drive[place] * to[factor];
      }
    }
    row = columns + free;
  }
  return sqrt(size);
}

/* The largest increment against the size of lengths and unknowns. */
static double size_of_step(const Track *t, const number *x, const number *dq) {
  const Arrow *a = &t->a;
  const Model *m = &t->m;
  double out = 0.0;
  FOR(j, a->unknowns) out = raised(out, cabs(dq[j]) / (1.0 + cabs(x[j])));
  FOR(i, a->rows) FOR(c, m->columns) {
    const double size = cabs(dq[a->head + i * m->columns + c]);
    out = raised(out, m->is_length[c] ? size / (1.0 + cabs(x[a->head + i * a->states + m->column_state[c]])) : size);
  }
  return out;
}

/* Rates of states for those of increments: Q' = (0, w) Q / 2 of rotations. */
static void state_rates(const Track *t, const number *x, const number *dq, number *out) {
  const Model *m = &t->m;
  FOR(j, t->a.head) out[j] = dq[j];
  FOR(i, t->a.rows) FOR(f, m->factors) {
    const int s = t->a.head + i * t->a.states + m->state[f], c = t->a.head + i * m->columns + m->column[f];
    if (m->kind[f] < MGK_ROTATION) out[s] = dq[c];
    if (m->kind[f] != MGK_ROTATION) continue;
    const number w[4] = {0.0, 0.5 * dq[c], 0.5 * dq[c + 1], 0.5 * dq[c + 2]};
    quaternion_product(w, x + s, out + s);
  }
}

static void made_normal(const Track *t, number *x) {
  FOR(i, t->a.rows) FOR(f, t->m.factors) if (t->m.kind[f] == MGK_ROTATION) {
    number *q = x + t->a.head + i * t->a.states + t->m.state[f];
    const number size = sqrt(dot(q, q, 4));
    FOR(r, 4) q[r] /= size;
  }
}

/* Tracks at states x[state] on their ways `which`, at `at` of these: the step of Newton's method step[head + rows columns] and the
 * rates; x then has what is asked and the norms of its directions. Where `rate` is not NULL x is a prediction: it is corrected by two
 * steps, the sizes of which are size[0..1], and rates are those of the states, times `rate`. size[2]: the largest number in a pose. */
void mgk_tracks(const int *I, const double *P, int numbers, const int *A, const number *mixing, const number *const *leg, int ways, int tracks,
                const int *which, const number *at, const number *rate, number *x, number *step, number *rates, double *size, number *memory) {
  Track t;
  open_track(I, P, A, numbers, memory, &t);
  const size_t T = tracks;
  const int length = t.a.head + t.a.rows * t.m.columns;
  FOR(k, tracks) {
    FOR(j, t.size) t.x[j] = x[j * T + k];
    put_on_way(&t, leg, ways, which[k], at[k]);
    if (rate) {
      made_normal(&t, t.x);
      linearized(&t, t.x, mixing, 1);
      advance_track(&t, t.x, t.step);
      size[k] = size_of_step(&t, t.x, t.step);
    }
    size[2 * T + k] = linearized(&t, t.x, mixing, 2);
    if (rate) {
      size[T + k] = size_of_step(&t, t.x, t.step);
      state_rates(&t, t.x, t.step + length, t.moved);
      FOR(j, t.size) rates[j * T + k] = rate[k] * t.moved[j];
      advance_track(&t, t.x, t.step);
    } else {
      FOR(j, length) step[j * T + k] = t.step[j], rates[j * T + k] = t.step[length + j];
    }
    FOR(j, t.size) x[j * T + k] = t.x[j];
  }
}
#endif

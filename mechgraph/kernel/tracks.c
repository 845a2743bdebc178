/* Steps of Newton's method and rates of the tracks of synthesis (synthesis/legs.py), one track after the other, in complex numbers: the closure
 * at all rows of a task with unknown dimensions z, row by row eliminated. A row is a state of the mechanism; its equations are those of loops
 * and couplings and, behind them, of rods (d^2 - l^2) / 2 (synthesis/rods.py). Part of derivative.c.
 *
 * A   rows, unknowns, head, states of a row, pairs with those of rods, rods, moved, asked, then one after the other:
 *       side[links]                             the pose among identity, markers A and markers B in which a link stands
 *       unknown, at, pair[moved]                marker number i of pair grows with an unknown, on the link at
 *       end[6 rods]                             of both ends of a rod the pair, the side on which the rod has it, and the body beyond
 *       way[rods pairs], through[loops pairs]   how a rod and a loop pass the pairs
 *       asked[asked], factor[asked]             columns, and the unknown that is their factor (-1: none)
 *       of every row: rank, settled, free, whether it is mixed, its free columns
 * Poses are [3][4][2][pairs], all arrays run with the tracks last.
 */

typedef struct {
  int rows, unknowns, head, states, pairs, rods, moved, asked;
  const int *side, *unknown, *at, *pair, *end, *way, *through, *column, *factor, *row;
} Arrow;

static void read_arrow(const Model *m, const int *A, Arrow *a) {
  a->rows = A[0], a->unknowns = A[1], a->head = A[2], a->states = A[3], a->pairs = A[4], a->rods = A[5], a->moved = A[6], a->asked = A[7];
  const int *i = A + 8;
  a->side = i, i += m->links, a->unknown = i, i += a->moved, a->at = i, i += a->moved, a->pair = i, i += a->moved, a->end = i, i += 6 * a->rods;
  a->way = i, i += a->rods * m->pairs, a->through = i, i += m->loops * m->pairs, a->column = i, i += a->asked, a->factor = i, i += a->asked;
  a->row = i;
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
        for (int r = j; r < n; r++) size += creal(M[r * w + c]) * creal(M[r * w + c]) + cimag(M[r * w + c]) * cimag(M[r * w + c]);
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
    for (int r = j; r < n; r++) v[r] = M[r * w + j], size += creal(v[r]) * creal(v[r]) + cimag(v[r]) * cimag(v[r]);
    if (j == n - 1) continue;
    const double long_side = sqrt(size), first = cabs(v[j]);
    if (long_side == 0.0) continue;
    v[j] = first > 0.0 ? v[j] * (1.0 + long_side / first) : long_side;
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

/* x[n][k] = S[n][n]^-1 x of rows [n][n + k], by pivots. */
static void solved_rows(int n, int k, number *S) {
  const int w = n + k;
  FOR(j, n) {
    int best = j;
    for (int r = j + 1; r < n; r++) if (cabs(S[r * w + j]) > cabs(S[best * w + j])) best = r;
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
  number *P, *own, *pose, *point, *J, *raw, *reduced, *S, *small, *line;
  int *order, height, wide;
} Track;

/* Memory of a track, its size in numbers. */
static size_t lay_out_track(Track *t, int numbers, number *memory) {
  const Model *m = &t->m;
  const int c = m->columns, f = t->wide, h = t->height;
  size_t size = 0;
#define TAKE(name, count) name = taken(&memory, &size, (count))
  TAKE(t->P, numbers), TAKE(t->own, 12 * m->links), TAKE(t->pose, 12 * m->links), TAKE(t->point, 6 * t->a.pairs);
  TAKE(t->w.pose, 12 * m->links), TAKE(t->w.frame, 12 * m->factors), TAKE(t->w.end, 12 * m->pairs), TAKE(t->w.S, 6 * c), TAKE(t->w.residual, m->rows);
  TAKE(t->w.middle, 3 * m->loops), TAKE(t->J, h * c), TAKE(t->raw, h * f), TAKE(t->reduced, t->a.rows * h * f), TAKE(t->S, t->a.unknowns * (t->a.unknowns + 2));
  TAKE(t->small, m->states + 2 * c * c + 4 * c + 3 * h + f), TAKE(t->line, 12 * t->a.rods);
  t->order = (int *)taken(&memory, &size, t->a.rows * c);
#undef TAKE
  return size;
}

static void open_track(const int *I, const double *P, const int *A, int numbers, number *memory, Track *t) {
  read_tables(I, (const number *)(memory ? memory : NULL), &t->m);
  read_arrow(&t->m, A, &t->a);
  t->height = t->m.rows + t->a.rods, t->wide = t->m.columns + t->a.unknowns + 2;
  lay_out_track(t, numbers, memory);
  FOR(i, memory ? numbers : 0) t->P[i] = P[i];
  t->w.evaluations = 0;
}

/* Numbers of memory, complex ones, for mgk_tracks. */
size_t mgk_tracks_size(const int *I, const int *A, int numbers) {
  Track t;
  open_track(I, NULL, A, numbers, NULL, &t);
  return lay_out_track(&t, numbers, NULL);
}

/* The markers of a track: every link has the frame of its pair in the tree. */
static void put_markers(Track *t, const number *marker, size_t T) {
  const Model *m = &t->m;
  const int p = t->a.pairs;
  number *own[2] = {(number *)m->marker_a, (number *)m->marker_b};
#define MARKER(r, c, side, k) marker[((((size_t)(r) * 4 + (c)) * 2 + (side)) * p + (k)) * T]
  FOR(side, 2) FOR(k, p) FOR(r, 3) t->point[6 * k + 3 * side + r] = MARKER(r, 3, side, k);
  FOR(i, m->links) {
    number *X = t->own + 12 * i;
    const int at = t->a.side[i] - 1;
    FOR(r, 3) FOR(c, 4) X[4 * r + c] = r == c;
    if (at < 0) continue;
    const int side = at >= m->pairs, k = at - side * m->pairs;
    FOR(r, 3) {
      FOR(c, 3) X[4 * r + c] = MARKER(c, r, side, k);
      FOR(c, 3) X[4 * r + 3] -= X[4 * r + c] * MARKER(c, 3, side, k);
    }
  }
  FOR(side, 2) FOR(k, m->pairs) {
    number X[12];
    FOR(r, 3) FOR(c, 4) X[4 * r + c] = MARKER(r, c, side, k);
    product(t->own + 12 * m->ends[2 * k + side], X, own[side] + 12 * k);
  }
#undef MARKER
}

/* The rods at a state: what they leave open, and their lines W = (p_b x d, d), with the way between their points on them, and their rows of J. */
static void put_rods(Track *t, number *open) {
  const Model *m = &t->m;
  FOR(i, t->a.rods) {
    const int *near = t->a.end + 6 * i, *far = near + 3;
    const number *inside[2] = {t->point + 6 * near[0] + 3 * near[1], t->point + 6 * far[0] + 3 * far[1]};
    number a[3], b[3], *W = t->line + 12 * i, sum = 0.0;
    point_of(t->pose + 12 * near[2], t->point + 6 * near[0] + 3 * (1 - near[1]), a);
    point_of(t->pose + 12 * far[2], t->point + 6 * far[0] + 3 * (1 - far[1]), b);
    FOR(r, 3) {
      const number e = (b[r] - inside[1][r]) - (a[r] - inside[0][r]);
      W[3 + r] = b[r] - a[r], W[6 + r] = inside[1][r] - inside[0][r];
      sum += e * (2.0 * W[3 + r] - e);
    }
    cross(b, W + 3, W);
    open[i] = 0.5 * sum;
    FOR(c, m->columns) {
      const int way = t->a.way[i * m->pairs + m->owner[c]];
      t->J[(m->rows + i) * m->columns + c] = way ? way * dot(W, t->w.S + 6 * c, 6) : 0.0;
    }
  }
}

/* How fast loops and rods open where a marker on a side of a pair moves by the twist eta in the frame of its link; of a pair of a rod by eta[3..5]. */
static void opened_by(const Track *t, int side, int pair, const number *eta, size_t T, number *out, int apart) {
  const Model *m = &t->m;
  number V[6], own[6], s[6];
  FOR(r, 6) own[r] = eta[r * T];
  FOR(r, t->height) out[r * apart] = 0.0;
  if (pair < m->pairs) {
    const number *X = t->pose + 12 * m->ends[2 * pair + side], at[3] = {X[3], X[7], X[11]};
    const double sense = side ? -1.0 : 1.0;
    turned(X, own, V), turned(X, own + 3, V + 3);
    cross(at, V, s);
    FOR(r, 3) V[3 + r] += s[r];
    FOR(l, m->loops) if (t->a.through[l * m->pairs + pair]) {
      twist_about(V, t->w.middle + 3 * l, s);
      FOR(r, m->height) out[(m->height * l + r) * apart] = sense * t->a.through[l * m->pairs + pair] * s[m->part + r];
    }
    FOR(i, t->a.rods) if (t->a.way[i * m->pairs + pair]) out[(m->rows + i) * apart] = sense * t->a.way[i * m->pairs + pair] * dot(t->line + 12 * i, V, 6);
    return;
  }
  FOR(i, t->a.rods) FOR(e, 2) {
    const int *end = t->a.end + 6 * i + 3 * e;
    const number *W = t->line + 12 * i;
    number line[3];
    if (end[0] != pair) continue;
    turned_back(t->pose + 12 * end[2], W + 3, line);
    FOR(r, 3) if (side == end[1]) line[r] = -W[6 + r];
    out[(m->rows + i) * apart] = (e ? 1.0 : -1.0) * dot(line, own + 3, 3);
  }
}

/* Of T tracks at states x[rows][states] with such markers the steps of Newton's method step[head + rows columns] and, unless NULL, rates: of
 * what is asked change[rows][asked], of known markers eta behind those of unknown ones [6][moved + known] at places known[2][known]. drive: what
 * is asked up to factors. mixing[rank][height] of all mixed rows, one after the other. size[tracks]: the largest number in a pose. */
void mgk_tracks(const int *I, const double *P, int numbers, const int *A, const number *mixing, int tracks, int n_known, const int *known,
                const number *marker, const number *states, const number *eta, const number *drive, const number *change, number *step,
                number *rates, double *size, number *memory) {
  Track t;
  open_track(I, P, A, numbers, memory, &t);
  const Model *m = &t.m;
  const Arrow *a = &t.a;
  const size_t T = tracks;
  const int c = m->columns, h = t.height, u = a->unknowns, sides = rates ? 2 : 1, every = a->moved + n_known;
  number *x = t.small, *v, *s, *b;
  FOR(k, tracks) {
    const int *row = a->row;
    const number *mix = mixing;
    int at = 0;
    size[k] = 0.0;
    put_markers(&t, marker + k, T);
    FOR(i, a->rows) {
      const int rank = row[0], settled = row[1], free = row[2], mixed = row[3], *columns = row + 4, w = free + u + sides;
      number *M = mixed ? t.raw : t.reduced + (size_t)i * h * t.wide, *out = t.reduced + (size_t)i * h * t.wide;
      x = t.small;
      FOR(j, m->states) x[j] = states[((size_t)i * a->states + j) * T + k];
      evaluate(m, &t.w, x);
      FOR(l, m->links) {
        product(t.w.pose + 12 * l, t.own + 12 * l, t.pose + 12 * l);
        FOR(j, 12) size[k] = raised(size[k], cabs(t.pose[12 * l + j]));
      }
      fill(m, t.w.S, t.w.middle, NULL, NULL, t.J);
      number *open = t.small + m->states;
      put_rods(&t, open);
      /* the rows of the closure: free columns, unknowns, right sides */
      FOR(r, h) {
        FOR(j, free) M[r * w + j] = t.J[r * c + columns[j]];
        FOR(j, u) M[r * w + free + j] = 0.0;
        M[r * w + free + u] = r < m->rows ? -t.w.residual[r] : -open[r - m->rows];
        if (rates) M[r * w + free + u + 1] = 0.0;
      }
      number *column = t.small;
      FOR(j, a->moved) {
        opened_by(&t, a->at[j], a->pair[j], eta + (size_t)j * T + k, (size_t)every * T, column, 1);
        FOR(r, h) M[r * w + free + a->unknown[j]] += column[r];
      }
      FOR(j, a->asked) {
        const size_t place = ((size_t)i * a->asked + j) * T + k;
        FOR(r, h) {
          const number own = t.J[r * c + a->column[j]];
          if (a->factor[j] >= 0) M[r * w + free + a->factor[j]] += own * drive[place];
          if (rates) M[r * w + free + u + 1] -= own * change[place];
        }
      }
      FOR(j, rates ? n_known : 0) {
        opened_by(&t, known[j], known[n_known + j], eta + (size_t)(a->moved + j) * T + k, (size_t)every * T, column, 1);
        FOR(r, h) M[r * w + free + u + 1] -= column[r];
      }
      if (mixed) {
        memset(out, 0, (size_t)rank * w * sizeof(number));
        FOR(r, rank) FOR(j, h) {
          const number part = mix[r * h + j];
          FOR(l, w) out[r * w + l] += part * M[j * w + l];
        }
        mix += (size_t)rank * h;
      }
      int *order = t.order + i * c;
      FOR(j, free) order[j] = j;
      v = t.small, s = v + h;
      reflected(rank, w, free, settled, out, settled < free ? order : NULL, v, s);
      FOR(r, rank - settled) FOR(j, u + sides) t.S[(at + r) * (u + sides) + j] = out[(settled + r) * w + free + j];
      at += rank - settled, row = columns + free;
    }
    solved_rows(u, sides, t.S);
    row = a->row;
    FOR(side, sides) {
      number *to = side ? rates : step;
      FOR(j, a->head + a->rows * c) to[(size_t)j * T + k] = 0.0;
      FOR(j, u) to[(size_t)j * T + k] = t.S[j * (u + sides) + u + side];
    }
    FOR(i, a->rows) {
      const int settled = row[1], free = row[2], *columns = row + 4, w = free + u + sides;
      const number *M = t.reduced + (size_t)i * h * t.wide;
      b = t.small, x = b + h, v = x + c, s = v + c;
      FOR(side, sides) {
        number *to = side ? rates : step;
        FOR(r, settled) {
          b[r] = M[r * w + free + u + side];
          FOR(j, u) b[r] -= M[r * w + free + j] * t.S[j * (u + sides) + u + side];
        }
        least(settled, free, w, M, t.order + i * c, b, x, s + 2 * c, v, s);
        FOR(j, free) to[((size_t)a->head + (size_t)i * c + columns[j]) * T + k] = x[j];
      }
      row = columns + free;
    }
  }
}

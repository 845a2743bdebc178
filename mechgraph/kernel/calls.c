/* What a compiled mechanism of the package calls beside the functions of kernel.h: many positions at once, poses of links, and derivatives
 * by complex numbers (derivative.c). */
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

/* The right-hand side of the equations of motion (motion.c): y = u, v of the first n drives, increments u counted from x0, where the
 * others have the position, rate and acceleration p[3][drives - n]. The state is predicted from a `known` one, x, q', q'', a time h before;
 * found: the same of this one. out: u', v', the power, the steepness and the condition. */
int mgk_motion(const int *I, const double *P, void *memory, int n, int stored, const double *x0, const double *y, const double *p,
               const double *known, double h, double *found, double *out) {
  Model m;
  Work w;
  Motion at;
  opened_motion(I, P, memory, &m, &w, &at);
  const int c = m.columns, d = m.drives;
  const double *dq = known + m.states, *ddq = dq + c;
  FOR(i, c) w.increment[i] = h * (dq[i] + 0.5 * h * ddq[i]);
  advance(&m, known, w.increment, found);
  int status = closed_at(&m, &w, &at, n, x0, y, p, found);
  if (status) return status;
  FOR(i, d) at.y[i] = i < n ? y[n + i] : p[d - 2 * n + i];
  status = accelerations(&m, &w, &at, n, found, at.y, p + 2 * (d - n), stored, out + 2 * n);
  if (status) return status;
  rates_of_increments(&m, &w, &at, n, x0, found, out);
  memcpy(out + n, at.a, n * sizeof(double));
  memcpy(found + m.states, w.dq, c * sizeof(double)), memcpy(found + m.states + c, w.ddq, c * sizeof(double));
  out[2 * n + 1] = fmax(1.0, size_of(at.Z, n * c));
  fill(&m, w.S, w.middle, NULL, NULL, w.a.matrix);
  out[2 * n + 2] = condition_of(&m, &w, w.a.matrix);
  return MGK_OK;
}

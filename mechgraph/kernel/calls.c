/* What a compiled mechanism of the package calls beside the functions of kernel.h: many positions at once, poses of links, and derivatives
 * by complex numbers (derivative.c). */
#include "kernel.c"

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

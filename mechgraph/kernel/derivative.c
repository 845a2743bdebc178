/* Derivatives by the numbers of a mechanism: the kernel's own source in complex numbers. At P + i h P' the closed state, rates and forces
 * are those of the mechanism plus i h times their derivatives, without any difference (W. Squire, G. Trapp, SIAM Review 40 (1998) 110-112).
 */
#include <complex.h>
#include <stddef.h>
#include <string.h>
#include <tgmath.h>
#undef I

typedef double magnitude;
typedef double _Complex number;
#define MGK_COMPLEX
#define REAL_PART(x) creal(x)
#define mgk_record mgk_complex_record
#define mgk_state_size mgk_complex_state_size
#define double double _Complex
#include "kernel.c"
#undef double

static const double STEP = 1e-40; /* its square is lost beside a derivative of any size */

/* Bytes of memory for mgk_derivative, P having `count` numbers. */
size_t mgk_derivative_size(const int *I, int count) { return mgk_state_size(I) + (count + I[MGK_STATES]) * sizeof(number); }

/* What is not unique has no derivative either. */
static double derivative(number value) { return isnan(creal(value)) ? creal(value) : cimag(value) / STEP; }

/* Derivatives along dP[count] at the closed state x, the drives moving as in motion[3][drives] (q, which stands in x, v, a): of efforts,
 * reactions and coordinates as of mgk_solve; of a rotation the rate w = 2 q' q^-1 in place of that of the coordinates. */
int mgk_derivative(const int *I, const double *P, const double *dP, int count, void *memory, const double *x0, const double *motion,
                   double *effort, double *reaction, double *position) {
  Model m;
  Work w;
  int places[MGK_PARTS + 1], status;
  magnitude largest[2] = {0.0, 0.0};
  number *p = memory, *x = p + count, *v, *a;
  FOR(i, count) p[i] = P[i] + _Complex_I * (STEP * dP[i]);
  read_tables(I, p, &m);
  lay_out(&m, x + m.states, &w);
  w.evaluations = w.factorizations = 0;
  mgk_record(I, places);
  const int d = m.drives;
  FOR(i, m.states) x[i] = x0[i];
  FOR(pass, 3) {
    evaluate(&m, &w, x);
    fill(&m, w.S, w.middle, NULL, NULL, w.lu);
    add_border(&m, &w, w.lu);
    if (!eliminate(&m, &w)) return MGK_SINGULAR;
    if (pass == 2) break;
    FOR(r, m.rows) w.row_value[r] = -w.residual[r];
    solve(&m, &w, w.row_value, w.column_value);
    memset(w.increment, 0, m.columns * sizeof(number));
    FOR(j, m.unknowns) w.increment[m.unknown[j]] = w.column_value[j];
    advance(&m, x, w.increment, x);
  }
  v = w.asked, a = v + d;
  FOR(i, d) {
    const number unit = m.is_length[m.drive[i]] ? *m.unit : 1.0;
    v[i] = motion[d + i] / unit, a[i] = motion[2 * d + i] / unit;
  }
  if ((status = rates(&m, &w, v, a)) || (status = forces(&m, &w, x, w.record, places, largest))) return status;
  FOR(i, d) effort[i] = derivative(effort_out(&m, w.record, places, m.drive[i]));
  FOR(k, m.pairs) {
    number out[6];
    given_out(&m, w.record, places, k, out);
    FOR(i, 6) reaction[6 * k + i] = derivative(out[i]);
  }
  FOR(f, m.factors) {
    const int c = m.column[f], s = m.state[f];
    if (m.kind[f] < MGK_ROTATION) position[c] = derivative(x[s] * (m.is_length[c] ? *m.unit : 1.0));
    if (m.kind[f] != MGK_ROTATION) continue;
    number rate[4], turn[4];
    FOR(i, 4) rate[i] = derivative(x[s + i]);
    const number back[4] = {x0[s], -x0[s + 1], -x0[s + 2], -x0[s + 3]};
    quaternion_product(rate, back, turn);
    FOR(i, 3) position[c + i] = 2.0 * creal(turn[1 + i]);
  }
  return MGK_OK;
}

#include "tracks.c"

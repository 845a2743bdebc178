/* mechgraph kernel: positions, rates and forces of one mechanism from tables, one state at a time.
 *
 * C99, no heap, no globals, re-entrant; nothing but the C library's mathematics. A mechanism is two flat arrays: I says what it is made
 * of, P holds its numbers. Lengths are divided by the unit L, forces by L and moments by L^2 (masses stay), positions are about an origin;
 * twists are (angular, linear), wrenches (moment, force), both about that origin, in the directions of the frame link.
 *
 * I   MGK_HEAD counts (below), then one after the other:
 *       first[pairs + 1]                        first factor of every pair
 *       kind[factors], column[factors + 1], state, number[factors]    see MGK_TURN ...; first column, first state number, place among the factor numbers
 *       ends[2 pairs]                           links a and b
 *       walk[4 (pairs - loops)]                 spanning tree from the frame: pair, whether from a to b, parent, child
 *       chord[loops]                            the other pairs
 *       loop_first[loops + 1], loop_pair[steps], loop_sign[steps]
 *       owner, column_state, is_length, place[columns]   pair, state number (-1: of a rotation), slide?, place among the unknowns or -1
 *       effort_factor, effort_at_b[columns]     frame of the effort (before that factor; -1: marker B), whether it acts at marker B
 *       dual[pairs]                             whether the efforts are combined to be dual to the freedoms
 *       drive[drives], unknown[unknowns]        columns
 *       term_first[couplings + 1], term_column[terms]
 *       passive_first[passives + 1], passive_link[links of all], turns[passives]   links that a passive motion moves as one; a turn?
 *       line[2 lines], line_first[lines + 1], line_step[2 steps of all]   couplings along lines: its number and the link on which the line stands
 *                                               still; pairs on the way from gear a to gear b, the sense in which each is passed
 *       belt_first[belts + 1], belt_coupling[spans of all]   belts with a pretension, of their spans the numbers among the couplings
 *       load[4 loads]                           kind (MGK_WEIGHT ...), two numbers, place among the load numbers
 * P   L, origin[3], start[states], start_coordinates[columns], frame[12], marker_a, marker_b[12 pairs], factor numbers, effort[6 columns],
 *     mass[links], center[3 links], inertia[6 links] (xx yy zz xy xz yz), base[12 links], border[passives columns], coefficients[terms], constants[couplings],
 *     line_wrench[12 lines] (on gear b for a positive and for a negative unit multiplier, in the frame of that link), belt_part[spans of all], pretension[belts] (the sum of multipliers of
 *     its spans times these), load numbers. Poses are three rows of four. Every link has the frame of its pair in the tree; its own is that times its base.
 *     The border holds rates of the passive motions at the start.
 */
#ifndef MECHGRAPH_KERNEL_H
#define MECHGRAPH_KERNEL_H
#include <stddef.h>

#define MGK_FORMAT 8

/* The counts at the head of I. */
enum {
  MGK_IS_FORMAT, MGK_LINKS, MGK_PAIRS, MGK_FACTORS, MGK_COLUMNS, MGK_STATES, MGK_LOOPS, MGK_STEPS, MGK_COUPLINGS, MGK_TERMS,
  MGK_DRIVES, MGK_UNKNOWNS, MGK_LOADS, MGK_FRAME, MGK_FACTOR_NUMBERS, MGK_LOAD_NUMBERS,
  MGK_PASSIVES, MGK_PASSIVE_LINKS, MGK_FIRST_PART, MGK_LOOP_ROWS, MGK_RUBS, MGK_LINES, MGK_LINE_STEPS, MGK_BELTS, MGK_BELT_SPANS, MGK_HEAD
};

/* Every loop closes MGK_LOOP_ROWS components of a twist, from MGK_FIRST_PART on: all six from 0 on, in the plane Rz Tx Ty from 2 on. */

/* Kinds of factors: a turn about x, y or z (number: its pitch), a slide along x, y or z, a rotation (four state numbers), a constant pose. */
enum { MGK_TURN = 0, MGK_SLIDE = 3, MGK_ROTATION = 6, MGK_POSE = 7 };

/* Kinds of loads and their numbers. Points in the frames that links have here.
 * weight: g[3]. wrench on link i, turning with it where j: force[3], moment[3], point[3]. effort in column i: value.
 * law in column i, or between points of links i and j: [p[3], q[3],] stiffness, rest, damping.
 * table likewise: [p[3], q[3],] coordinate at its 0, over the rate (1) or the coordinate (0), whether the force at its ends holds beyond them,
 * pieces n, breaks[n + 1], of every piece four coefficients behind its first break, the highest first. */
enum { MGK_WEIGHT, MGK_WRENCH, MGK_EFFORT, MGK_LAW, MGK_BETWEEN, MGK_TABLE, MGK_TABLE_BETWEEN, MGK_CONTACT, MGK_PLANE, MGK_BALL, MGK_THREAD, MGK_AXIS, MGK_COUPLE, MGK_COLLAR, MGK_OPENING, MGK_TEETH };

/* From MGK_CONTACT on a place of pair i that rubs, MGK_RUBS of them, numbers below: coefficients in motion and at rest, between which it
 * falls at sliding speeds (0: it does not), preload, whether marker B is its middle (else A), columns of its turn and slide (-1: none; of
 * a contact: the factor before which the frame of its normal force stands; of one that opens the column in which it does, and that factor as
 * the turn), radius, part of the force that a friction circle leaves (1) or
 * not (0), pitch, one over the distance of two places on an axis with the side on which it lies (0: in the middle), width of a guide,
 * tangent of the flank of a thread. Of teeth in place of a pair the number among the lines; the radius is the arm at which they slide against
 * each other's turn, negative where that is not known, or where a slide is named (1) they slide at their point. Behind the others their efficiency (0: they have a
 * coefficient); for both flanks the normal force of a unit multiplier and the point, screws of gears a and b in the frame of the carrier. */
enum { MGK_MU, MGK_STATIC, MGK_SPEED, MGK_PRELOAD, MGK_AT_B, MGK_TURN_OF, MGK_SLIDE_OF, MGK_RADIUS, MGK_CIRCLE, MGK_PITCH, MGK_SIDE, MGK_WIDTH, MGK_FLANK, MGK_EFFICIENCY, MGK_PER, MGK_MESHES_AT = MGK_PER + 2, MGK_SCREWS = MGK_MESHES_AT + 6 };

/* What comes back: 0, or why a position is not given. */
enum {
  MGK_OK = 0,
  MGK_NOT_CLOSED = 1,   /* the start is not closed to rounding */
  MGK_SINGULAR = 2,     /* the drives do not determine the motion well: near a dead point or a change point */
  MGK_STEP = 3,         /* a step could not be certified at the smallest length: a dead point, an end of the reach, a branch near by */
  MGK_CONTRADICTION = 4,/* motions of the drives contradict each other */
  MGK_NOT_FINITE = 5,   /* a load or a rate gives no finite number */
  MGK_STRAIN = 6,       /* drives or couplings strain each other without any reaction */
  MGK_TOO_FAR = 7,      /* more steps than are made */
  MGK_FORMAT_ERROR = 8, /* tables of another version */
  MGK_NOT_PASSIVE = 9,  /* a passive motion moves other links here, or is not told from another one */
  MGK_FRICTION = 10,    /* friction jams here, has no finite force, or no solution that is surely the only one */
  MGK_FLANKS = 11       /* flanks on which gears that are redundant press are not found */
};

/* Parts of a record, in order, for one position (condition: that number, and how far links reach, by which rounding counts; unsure: 1 where friction has no sure solution, 2 where nothing moves); s = rows of loops + couplings + passives - unknowns - belts with a pretension self-stresses. */
enum {
  MGK_X, MGK_COORDINATES, MGK_DQ, MGK_DDQ, MGK_CLOSURE, MGK_CONDITION, MGK_POINTS, MGK_REACTIONS, MGK_EFFORTS, MGK_GIVEN, MGK_BODY_LOADS, MGK_STRESS,
  MGK_STRESS_EFFORTS, MGK_COUPLED, MGK_MULTIPLIERS, MGK_MULTIPLIER_STRESS, MGK_COUPLED_STRESS, MGK_SHAKING, MGK_BALANCE, MGK_POWER,
  MGK_HOLD, MGK_HOLDS, MGK_HOLD_TERMS, MGK_RUBBED, MGK_TAKEN, MGK_NORMALS, MGK_SPEEDS, MGK_TEETH_EFFORTS, MGK_RUBBING, MGK_UNSURE, MGK_PARTS
};

/* Where the parts of a record begin, and behind the last one its length: places[MGK_PARTS + 1]. */
int mgk_record(const int *I, int *places);

/* Bytes of the memory that a caller gives to the functions below, aligned as malloc does. */
size_t mgk_state_size(const int *I);

/* Begin at the start of P. */
int mgk_start(const int *I, const double *P, void *state);

/* One state, led on from the last good one along a straight line of the drives q[drives], with their rates v and a: all in the units of the
 * declaration. effort[drives]; reaction[6 pairs] of a on b, (M, F) about the global origin; position[columns]; any of them may be NULL.
 * Numbers that are not unique are NaN. Unless 0 is returned the state stays where it was. */
int mgk_solve(const int *I, const double *P, void *state, const double *q, const double *v, const double *a, double *effort,
              double *reaction, double *position);

/* Positions q, v, a [n][drives] in internal units, taken in the order of order[count] (NULL: 0, 1, ...) along the polygon from the start.
 * A record a position in out[n][length], which ends before MGK_POINTS unless forces are asked for. largest[2]: the largest wrench and power met so far, raised.
 * done: how many positions of the order have come out; work[3]: steps, evaluations and factorizations, raised. */
int mgk_path(const int *I, const double *P, void *state, int count, const int *order, const double *q, const double *v,
             const double *a, int forces, double *out, double *largest, int *done, long *work);
#endif

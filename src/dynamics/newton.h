// SPDX-License-Identifier: BSD-3-Clause
// The contact solver `newton`: exact Coulomb friction by a semismooth Newton method on the velocities of all
// bodies that touch (newton.c). Memory of the solver's table; internal to the dynamics. Pure.
#ifndef NEWTON_H
#define NEWTON_H

#include "dynamics/blocks.h"
#include "dynamics/newton_contact.h"
#include "dynamics/newton_row.h"
#include "dynamics/solver.h"

typedef struct gv_newton_node {  // a body that moves and has a contact
  int body;                      // of the caller
  double mass;
  gv_mat3 inertia, inverse_inertia;
} gv_newton_node;

// A limb that touches one other body is eliminated before the matrix, and stays so while
// its contacts keep their modes.
typedef struct gv_newton_limb {
  int node, other;   // itself and that body; -1: it does not move
  int first, count;  // its contacts in gv_newton.of_limb
  bool changed;
  gv_block own, coupling;  // L U of its diagonal, L^-1 of its coupling: with two contacts and more
  gv_six right;            // L^-1 of its right-hand side, likewise
  gv_block schur;          // what the other body sees of its contacts
  gv_six push;
} gv_newton_limb;

typedef struct gv_newton_guess {
  int body_a, body_b;
  gv_vec3 friction_dir;
  double lambda;
  gv_newton_state state;
  uint8_t spin;      // state of the patch's row,
  double spin_most;  // and its bound, N m s
} gv_newton_guess;

typedef struct gv_newton {
  gv_newton_guess
      last[GV_MAX_CONTACTS];  // active set of the last step that was solved, where the next begins
  int last_count;
  uint8_t last_row[GV_MAX_ROWS];  // states of joints' rows then, by slot
  // about the last problem
  int solves;        // of linear equations
  int stage;         // of the programme that ended it
  double softening;  // factor on the tangent compliance that was accepted; 1: none
  // work
  double time_left_s;       // of the budget, reckoned in operations
  int assembled;            // 6 x 6 blocks of contacts in the last solution,
  int most_assembled;       // and where everything changes
  int count, nodes, limbs;  // nodes: first those in `blocks`, then the limbs that are eliminated
  int node_of[GV_BODIES];   // -1: does not move, or touches nothing
  gv_newton_contact contact[GV_MAX_CONTACTS];
  gv_newton_mode kept[GV_MAX_CONTACTS];
  int rows;  // of joints, then of contacts' patches
  gv_newton_row row[GV_MAX_ROWS + GV_MAX_CONTACTS];
  gv_newton_node node[GV_NODES];
  gv_newton_limb limb[GV_HANDS * GV_LIMBS];
  int of_limb[GV_MAX_CONTACTS];  // contacts, limb by limb
  gv_six dv[GV_NODES];           // v - v_free
  gv_blocks blocks;
} gv_newton;

#endif

// SPDX-License-Identifier: BSD-3-Clause
// The peer of the narrow phase: coal (formerly hpp-fcl), with its functors and its cached guess, which is how
// its authors use it for moving bodies. Behind plain C functions for bench_pairs.c.
#include "bench/bench_coal.h"

#include <coal/collision.h>
#include <coal/distance.h>
#include <coal/shape/convex.h>
#include <coal/shape/geometric_shapes.h>

#include <memory>

struct shape {
  std::shared_ptr<coal::CollisionGeometry> geometry;
  bool lies;  // coal's capsules stand along z, ours lie along x
};

struct coal_pair {
  coal_pair(const shape *a, const shape *b)
      : a(a), b(b), distance(a->geometry.get(), b->geometry.get()), collide(a->geometry.get(), b->geometry.get()) {
    ask_distance.gjk_initial_guess = coal::GJKInitialGuess::CachedGuess;
    ask_distance.enable_signed_distance = true;
    ask_collide.gjk_initial_guess = coal::GJKInitialGuess::CachedGuess;
    ask_collide.num_max_contacts = 1;
  }
  const shape *a, *b;
  coal::ComputeDistance distance;
  coal::ComputeCollision collide;
  coal::DistanceRequest ask_distance;
  coal::CollisionRequest ask_collide;
};

static coal::Transform3s place(const shape *s, const double p[7]) {
  coal::Quatf q(p[3], p[4], p[5], p[6]);
  if (s->lies) q = q * coal::Quatf(0.70710678118654752, 0, 0.70710678118654752, 0);
  return coal::Transform3s(q, coal::Vec3s(p[0], p[1], p[2]));
}

void *coal_capsule(double half_length, double radius) {
  return new shape{std::make_shared<coal::Capsule>(radius, 2 * half_length), true};
}

void *coal_rounded_box(const double half[3], double radius) {
  auto box = std::make_shared<coal::Box>(2 * half[0], 2 * half[1], 2 * half[2]);
  box->setSweptSphereRadius(radius);
  return new shape{box, false};
}

void *coal_hull(const double *xyz, int count, const int *triangles, int triangle_count) {
  auto points = std::make_shared<std::vector<coal::Vec3s>>();
  auto faces = std::make_shared<std::vector<coal::Triangle>>();
  for (int i = 0; i < count; i++) points->emplace_back(xyz[3 * i], xyz[3 * i + 1], xyz[3 * i + 2]);
  for (int i = 0; i < triangle_count; i++) {
    const int *t = &triangles[3 * i];
    faces->emplace_back(static_cast<coal::Triangle::index_type>(t[0]), static_cast<coal::Triangle::index_type>(t[1]),
                        static_cast<coal::Triangle::index_type>(t[2]));
  }
  return new shape{std::make_shared<coal::Convex<coal::Triangle>>(points, static_cast<unsigned>(count), faces,
                                                                  static_cast<unsigned>(triangle_count)), false};
}

coal_pair *coal_pair_new(void *a, void *b) { return new coal_pair(static_cast<shape *>(a), static_cast<shape *>(b)); }

double coal_pair_distance(coal_pair *pair, const double a[7], const double b[7]) {
  coal::DistanceResult result;
  pair->distance(place(pair->a, a), place(pair->b, b), pair->ask_distance, result);
  pair->ask_distance.updateGuess(result);
  return result.min_distance;
}

int coal_pair_collide(coal_pair *pair, const double a[7], const double b[7], double margin) {
  coal::CollisionResult result;
  pair->ask_collide.security_margin = margin;
  pair->collide(place(pair->a, a), place(pair->b, b), pair->ask_collide, result);
  pair->ask_collide.updateGuess(result);
  return static_cast<int>(result.numContacts());
}

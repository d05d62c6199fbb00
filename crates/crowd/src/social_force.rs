//! The social force model.

use crate::model::{Surroundings, WalkingModel};
use crate::vector::Vector;

/// The social force model: people are driven to their desired velocity, and repelled by others and by walls. \[I\] Helbing, Molnár
/// 1995, "Social force model for pedestrian dynamics"; with body forces and the parameters of \[I\] Helbing, Farkas, Vicsek 2000,
/// "Simulating dynamical features of escape panic", divided by the mass of 80 kg.
///
/// dv/dt = (v0 e - v)/τ + sum (A exp((r - d)/B) w + k g(r - d)) n + κ g(r - d) Δv t, with the distance d, the sum r of both radii,
/// g(x) = max(0, x), the normal n and the tangent t. w is the weight of what is seen at an angle φ to the way, λ + (1 - λ)(1 + cos φ)/2
/// \[I\] Helbing et al. 2005.
///
/// All of this is cited from memory and was not checked in the sources \[I\].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SocialForce {
    /// τ, the time in which people accelerate, s. \[I\] 0.5.
    pub relaxation_s: f64,
    /// A, strength of the social repulsion, m/s². \[I\] 2000 N / 80 kg = 25.
    pub repulsion_mps2: f64,
    /// B, range of the social repulsion, m. \[I\] 0.08.
    pub range_m: f64,
    /// k, stiffness of bodies, 1/s². \[I\] 120,000 kg/s² / 80 kg = 1500.
    pub stiffness_per_s2: f64,
    /// κ, sliding friction of bodies, 1/(m s). \[I\] 240,000 kg/(m s) / 80 kg = 3000.
    pub friction_per_m_s: f64,
    /// λ, weight of what is behind. \[I\] 1 in 2000, as much as what is in front; 0.1 in 2005.
    pub behind: f64,
    /// Space that a person needs beyond their radius for each m/s that they walk, s. \[I\] Seyfried, Steffen, Lippert 2006, 0.53 s
    /// for d = 0.36 m + 0.53 s v; 0 in the sources above.
    pub stride_s: f64,
    /// Largest speed over the desired one. \[I\] 1.3 in 1995.
    pub fastest: f64,
    /// Radius of bodies, m. \[I\] 0.25 to 0.35 in 2000.
    pub radius_m: f64,
}

impl SocialForce {
    /// The parameters of Helbing, Farkas, Vicsek 2000, with the smallest radius that they give. \[I\]
    #[must_use]
    pub const fn published() -> Self {
        Self {
            relaxation_s: 0.5,
            repulsion_mps2: 25.0,
            range_m: 0.08,
            stiffness_per_s2: 1500.0,
            friction_per_m_s: 3000.0,
            behind: 1.0,
            stride_s: 0.0,
            fastest: 1.3,
            radius_m: 0.25,
        }
    }

    /// Repulsion at a distance between the edges of two bodies, m/s².
    fn repulsion(&self, gap_m: f64) -> f64 {
        self.repulsion_mps2 * libm::exp(-gap_m / self.range_m)
    }
}

impl Default for SocialForce {
    fn default() -> Self {
        Self::published()
    }
}

impl WalkingModel for SocialForce {
    fn reach_m(&self) -> f64 {
        // A exp(-12) is 1.5e-4 m/s².
        2.0 * self.radius_m + 12.0 * self.range_m + 1.34 * self.stride_s
    }

    fn longest_step_s(&self) -> f64 {
        // Twice the stiffness acts on both: the step is well below 2/sqrt(2 k).
        0.01
    }

    fn body_radius_m(&self) -> f64 {
        self.radius_m
    }

    fn velocity(&self, seen: &Surroundings<'_>) -> Vector {
        let person = seen.person;
        let mut force =
            (seen.toward * seen.desired_mps - person.velocity) * (1.0 / self.relaxation_s);

        let stride_m = self.stride_s * person.velocity.length();
        for other in seen.others {
            let normal = other.offset * (-1.0 / other.distance_m);
            let gap_m = other.distance_m - person.radius_m - other.radius_m;
            let ahead = -normal.dot(seen.toward);
            let weight = self.behind + (1.0 - self.behind) * (1.0 + ahead) / 2.0;
            force += normal * (self.repulsion(gap_m - stride_m * ahead.max(0.0)) * weight);
            if gap_m < 0.0 {
                force += self.contact(gap_m, normal, other.velocity - person.velocity);
            }
        }
        for wall in seen.walls {
            if wall.distance_m > 0.0 {
                let normal = wall.offset * (-1.0 / wall.distance_m);
                let gap_m = wall.distance_m - person.radius_m;
                force += normal * self.repulsion(gap_m);
                if gap_m < 0.0 {
                    force += self.contact(gap_m, normal, -person.velocity);
                }
            }
        }

        let fastest_mps = self.fastest * person.desired_mps;
        (person.velocity + force * seen.step_s).at_most(fastest_mps)
    }
}

impl SocialForce {
    /// Body force and friction of two that touch, m/s².
    fn contact(&self, gap_m: f64, normal: Vector, relative: Vector) -> Vector {
        let tangent = Vector::new(-normal.y, normal.x);
        let push = normal * (-self.stiffness_per_s2 * gap_m);
        let friction = tangent * (-self.friction_per_m_s * gap_m * relative.dot(tangent));
        push + friction
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Neighbor;
    use crate::pedestrian::Pedestrian;

    #[test]
    fn who_is_alone_speeds_up_as_the_closed_form_says() {
        let model = SocialForce::published();
        let mut person = Pedestrian::at(Vector::ZERO);
        let step_s = 0.001;
        for _ in 0..500 {
            person.velocity = model.velocity(&Surroundings {
                person: &person,
                toward: Vector::new(1.0, 0.0),
                desired_mps: 1.34,
                others: &[],
                walls: &[],
                step_s,
            });
        }
        // v0 (1 - exp(-t/τ)) after one τ, to the order of the step.
        let expected = 1.34 * (1.0 - libm::exp(-1.0));
        assert!((person.velocity.x - expected).abs() < 1e-3);
    }

    #[test]
    fn two_who_touch_are_pushed_apart_with_the_published_force() {
        let model = SocialForce::published();
        let person = Pedestrian {
            radius_m: 0.25,
            ..Pedestrian::at(Vector::ZERO)
        };
        let velocity = model.velocity(&Surroundings {
            person: &person,
            toward: Vector::ZERO,
            desired_mps: 0.0,
            others: &[Neighbor {
                offset: Vector::new(0.49, 0.0),
                distance_m: 0.49,
                radius_m: 0.25,
                velocity: Vector::ZERO,
            }],
            walls: &[],
            step_s: 0.01,
        });
        let acceleration = 25.0 * libm::exp(0.01 / 0.08) + 1500.0 * 0.01;
        assert!(
            (velocity.x + 0.01 * acceleration).abs() < 1e-12,
            "{velocity:?}"
        );
    }
}

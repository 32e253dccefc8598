//! A simulated servo, whatever it speaks.
use super::disturbance::Disturbance;
use super::plant::PlantParameters;
use super::planted::PlantedObject;
use crate::frame::CanFrame;
use crate::servo::Nanos;
use std::any::Any;
use std::fmt::Debug;

/// What a simulated servo is made of.
pub trait ModelParameters: Any + Debug {
    /// The servo, which powers up at the first call of [`ServoModel::advance`]; of a drive, these objects are changed.
    fn build(&self, objects: &[PlantedObject]) -> Box<dyn ServoModel>;
    /// Its mechanics.
    fn plant_mut(&mut self) -> &mut PlantParameters;
    /// Link angle at power-up.
    fn start_rad_mut(&mut self) -> &mut f64;
    /// Whether the servo has this object, and it can hold this value; none: it has no objects.
    fn takes_object(&self, object: PlantedObject) -> Option<bool> {
        let _ = object;
        None
    }
}

impl dyn ModelParameters {
    /// The parameters, if they are of this type.
    #[must_use]
    pub fn get<T: 'static>(&self) -> Option<&T> {
        let any: &dyn Any = self;
        any.downcast_ref()
    }
    /// The same, to be changed.
    pub fn get_mut<T: 'static>(&mut self) -> Option<&mut T> {
        let any: &mut dyn Any = self;
        any.downcast_mut()
    }
}

/// A simulated servo: frames and time in, frames out, no clock and no I/O.
pub trait ServoModel: Any + Debug + Send {
    /// Lets time pass up to `now`, and pushes what the servo sends by itself.
    fn advance(&mut self, now: Nanos, out: &mut Vec<CanFrame>);
    /// Takes a frame from the bus and pushes the answers. Frames for others, and malformed ones, change nothing.
    fn receive(&mut self, now: Nanos, frame: &CanFrame, out: &mut Vec<CanFrame>);
    /// Puts a fault into the servo, or takes it away.
    fn disturb(&mut self, disturbance: Disturbance, out: &mut Vec<CanFrame>);
    /// It follows commands with torque.
    fn is_enabled(&self) -> bool;
    /// True angle of the link, which no encoder fault can bend.
    fn position_rad(&self) -> f64;
    /// True angular velocity of the link.
    fn velocity_rad_s(&self) -> f64;
    /// Its number on the bus.
    fn node_id(&self) -> u8;
    /// Its states, for the operator: `key=value` words of its protocol.
    fn describe(&self) -> String;
    /// From now on the weight of the arm's masses acts on the joint, this torque in the present pose, instead of a pendulum's.
    /// False: this servo's mechanics cannot.
    fn weigh(&mut self, weight_nm: f64) -> bool {
        let _ = weight_nm;
        false
    }
    /// The same servo once more.
    fn boxed_clone(&self) -> Box<dyn ServoModel>;
}

impl dyn ServoModel {
    /// The servo, if it is of this type: `servo.get::<Drive>()`.
    #[must_use]
    pub fn get<T: 'static>(&self) -> Option<&T> {
        let any: &dyn Any = self;
        any.downcast_ref()
    }
}

impl Clone for Box<dyn ServoModel> {
    fn clone(&self) -> Self {
        (**self).boxed_clone()
    }
}

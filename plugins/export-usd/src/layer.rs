//! A layer as data: prims with properties. Long lists of numbers are made only as they are written, so they are never in memory as a
//! whole.

use std::io::Result;
use std::rc::Rc;

/// The number type of one component.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Component {
    Bool,
    Int,
    Half,
    Float,
    Double,
    /// Text: a token, a string or the path of a file.
    Text,
}

/// Type of an attribute.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Type {
    /// Name of the type in `.usda`.
    pub name: &'static str,
    /// Type code in crate files.
    pub code: u8,
    pub component: Component,
    /// Components in an element.
    pub width: usize,
}

const fn attribute_type(name: &'static str, code: u8, component: Component, width: usize) -> Type {
    Type { name, code, component, width }
}

pub(crate) const BOOL: Type = attribute_type("bool", 1, Component::Bool, 1);
pub(crate) const INT: Type = attribute_type("int", 3, Component::Int, 1);
pub(crate) const FLOAT: Type = attribute_type("float", 8, Component::Float, 1);
pub(crate) const DOUBLE: Type = attribute_type("double", 9, Component::Double, 1);
pub(crate) const STRING: Type = attribute_type("string", 10, Component::Text, 1);
pub(crate) const TOKEN: Type = attribute_type("token", 11, Component::Text, 1);
pub(crate) const ASSET: Type = attribute_type("asset", 12, Component::Text, 1);
pub(crate) const MATRIX4D: Type = attribute_type("matrix4d", 15, Component::Double, 16);
pub(crate) const QUATF: Type = attribute_type("quatf", 17, Component::Float, 4);
pub(crate) const QUATH: Type = attribute_type("quath", 18, Component::Half, 4);
pub(crate) const FLOAT2: Type = attribute_type("float2", 20, Component::Float, 2);
pub(crate) const TEXCOORD2F: Type = attribute_type("texCoord2f", 20, Component::Float, 2);
pub(crate) const DOUBLE3: Type = attribute_type("double3", 23, Component::Double, 3);
pub(crate) const FLOAT3: Type = attribute_type("float3", 24, Component::Float, 3);
pub(crate) const COLOR3F: Type = attribute_type("color3f", 24, Component::Float, 3);
pub(crate) const POINT3F: Type = attribute_type("point3f", 24, Component::Float, 3);
pub(crate) const NORMAL3F: Type = attribute_type("normal3f", 24, Component::Float, 3);
pub(crate) const VECTOR3F: Type = attribute_type("vector3f", 24, Component::Float, 3);
pub(crate) const HALF3: Type = attribute_type("half3", 25, Component::Half, 3);
pub(crate) const FLOAT4: Type = attribute_type("float4", 28, Component::Float, 4);

impl Type {
    /// Whether the type is a quaternion, whose order is x, y, z, w in memory and in crate files, and w, x, y, z in text.
    pub(crate) fn is_quaternion(&self) -> bool {
        matches!(self.name, "quatf" | "quath")
    }
}

/// The number at an index; an element has [`Type::width`] numbers.
pub(crate) type Numbers<'a> = Rc<dyn Fn(usize) -> f64 + 'a>;

#[derive(Clone)]
pub(crate) enum Value<'a> {
    /// Numbers made on demand. `count`: elements of an array, `None` for a single value.
    Numbers {
        count: Option<usize>,
        number: Numbers<'a>,
    },
    Text(String),
    Texts(Vec<String>),
}

impl<'a> Value<'a> {
    /// A single value.
    pub(crate) fn one(numbers: impl Into<Vec<f64>>) -> Value<'a> {
        let numbers = numbers.into();
        Value::Numbers { count: None, number: Rc::new(move |i| numbers[i]) }
    }

    /// An array whose numbers a function makes on demand.
    pub(crate) fn array(count: usize, number: impl Fn(usize) -> f64 + 'a) -> Value<'a> {
        Value::Numbers { count: Some(count), number: Rc::new(number) }
    }

    pub(crate) fn text(text: impl Into<String>) -> Value<'a> {
        Value::Text(text.into())
    }
}

/// Receives the numbers of one time sample.
pub(crate) type RowSink<'t> = &'t mut dyn FnMut(&[f64]) -> Result<()>;

/// Time samples, with times in frames.
#[derive(Clone)]
pub(crate) struct Samples<'a> {
    pub times: Rc<[f64]>,
    pub values: SampleValues<'a>,
}

#[derive(Clone)]
pub(crate) enum SampleValues<'a> {
    /// Numbers made on demand. `count`: as in [`Value`]. `each` hands over the numbers of one time after the other.
    Numbers {
        count: Option<usize>,
        each: Rc<dyn Fn(RowSink<'_>) -> Result<()> + 'a>,
    },
    Texts(Vec<&'static str>),
}

impl<'a> Samples<'a> {
    /// Samples from a list that has `width` numbers for each time.
    pub(crate) fn of(times: Rc<[f64]>, count: Option<usize>, width: usize, numbers: Vec<f64>) -> Samples<'a> {
        let each = move |take: RowSink<'_>| numbers.chunks(width.max(1)).try_for_each(&mut *take);
        Samples { times, values: SampleValues::Numbers { count, each: Rc::new(each) } }
    }
}

#[derive(Clone)]
pub(crate) struct Attribute<'a> {
    pub name: String,
    pub value_type: Type,
    pub is_array: bool,
    pub uniform: bool,
    pub value: Option<Value<'a>>,
    pub samples: Option<Samples<'a>>,
    /// The path of the shader output that drives the attribute.
    pub connection: Option<String>,
    pub interpolation: Option<&'static str>,
    pub element_size: Option<usize>,
}

#[derive(Clone)]
pub(crate) enum Property<'a> {
    Attribute(Attribute<'a>),
    Relationship { name: &'static str, targets: Vec<String> },
}

/// A value in a metadata dictionary.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Meta {
    Double(f64),
    Text(String),
    Dictionary(Vec<(String, Meta)>),
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Specifier {
    #[default]
    Def,
    Over,
    Class,
}

#[derive(Clone, Default)]
pub(crate) struct Prim<'a> {
    pub name: String,
    pub specifier: Specifier,
    /// Name of the schema, "Mesh"; empty for overs.
    pub kind: &'static str,
    pub api: Vec<&'static str>,
    /// The path of the prim in this layer that the prim refers to.
    pub reference: Option<String>,
    /// The original name, where the identifier differs.
    pub display_name: Option<String>,
    pub custom: Vec<(String, Meta)>,
    pub properties: Vec<Property<'a>>,
    pub children: Vec<Prim<'a>>,
}

impl<'a> Prim<'a> {
    pub(crate) fn new(kind: &'static str, name: impl Into<String>) -> Prim<'a> {
        Prim { name: name.into(), kind, ..Prim::default() }
    }

    pub(crate) fn over(name: impl Into<String>) -> Prim<'a> {
        Prim { name: name.into(), specifier: Specifier::Over, ..Prim::default() }
    }

    /// Adds an attribute, and returns it for further changes.
    pub(crate) fn add_attribute(&mut self, value_type: Type, name: impl Into<String>) -> &mut Attribute<'a> {
        let (is_array, uniform, value, samples) = (false, false, None, None);
        let (connection, interpolation, element_size) = (None, None, None);
        let name = name.into();
        self.properties.push(Property::Attribute(Attribute {
            name,
            value_type,
            is_array,
            uniform,
            value,
            samples,
            connection,
            interpolation,
            element_size,
        }));
        match self.properties.last_mut() {
            Some(Property::Attribute(attribute)) => attribute,
            _ => unreachable!("an attribute has been pushed"),
        }
    }

    pub(crate) fn set(
        &mut self,
        value_type: Type,
        name: impl Into<String>,
        value: Value<'a>,
    ) -> &mut Attribute<'a> {
        self.add_attribute(value_type, name).set_value(value)
    }

    /// Sets an attribute to a single number or vector.
    pub(crate) fn set_number(
        &mut self,
        value_type: Type,
        name: impl Into<String>,
        numbers: &[f32],
    ) -> &mut Attribute<'a> {
        let numbers: Vec<f64> = numbers.iter().map(|v| f64::from(*v)).collect();
        self.set(value_type, name, Value::one(numbers))
    }

    /// Sets a uniform token.
    pub(crate) fn set_uniform_token(&mut self, name: &str, token: &str) {
        self.set(TOKEN, name, Value::text(token)).uniform = true;
    }

    /// Sets a uniform list of tokens.
    pub(crate) fn set_uniform_tokens(&mut self, name: &str, tokens: Vec<String>) {
        self.set(TOKEN, name, Value::Texts(tokens)).uniform = true;
    }

    pub(crate) fn add_relationship(&mut self, name: &'static str, targets: Vec<String>) {
        self.properties.push(Property::Relationship { name, targets });
    }
}

impl<'a> Attribute<'a> {
    /// Whether the property belongs to no schema: `userProperties:`, which other programs show as custom properties.
    pub(crate) fn is_custom(&self) -> bool {
        self.name.starts_with("userProperties:")
    }

    pub(crate) fn set_value(&mut self, value: Value<'a>) -> &mut Self {
        self.is_array = matches!(value, Value::Numbers { count: Some(_), .. } | Value::Texts(_));
        self.value = Some(value);
        self
    }

    pub(crate) fn set_samples(&mut self, samples: Samples<'a>) -> &mut Self {
        self.is_array = matches!(samples.values, SampleValues::Numbers { count: Some(_), .. });
        self.samples = Some(samples);
        self
    }

    /// Sets the interpolation of a primvar: "vertex", "constant".
    pub(crate) fn set_interpolation(&mut self, interpolation: &'static str) -> &mut Self {
        self.interpolation = Some(interpolation);
        self
    }
}

/// A whole file.
#[derive(Clone, Default)]
pub(crate) struct Layer<'a> {
    pub default_prim: String,
    /// End of the timeline, in frames.
    pub end: f64,
    pub frames_per_second: f64,
    pub comment: String,
    pub custom: Vec<(String, Meta)>,
    pub prims: Vec<Prim<'a>>,
}

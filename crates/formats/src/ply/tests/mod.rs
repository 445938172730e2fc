mod damage;
mod encodings;
mod faces;
mod writer;

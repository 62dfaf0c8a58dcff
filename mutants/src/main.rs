//! Writes a copy of a crate's sources in which many mutants are there at once: `a + b` becomes
//! `if mutant::on(7) { a - b } else { a + b }`. The variable MUTANT chooses one when the tests run, so all are compiled once.
//!
//! `hog_core-mutants list CRATE FILE...` lists every mutant; FILE is relative to CRATE/src.
//! `hog_core-mutants write CRATE OUT FILE...` writes those whose numbers standard input holds into the copy OUT.

use std::collections::HashSet;
use std::path::Path;

use quote::{ToTokens, quote};
use syn::spanned::Spanned;
use syn::visit_mut::{self, VisitMut};
use syn::{BinOp, Expr, ExprLit, Item, Lit, Stmt, UnOp, parse_quote};

struct Mutator<'a> {
    file: &'a str,
    next: &'a mut u32,
    list: &'a mut Vec<String>,
    chosen: &'a HashSet<u32>,
}

impl Mutator<'_> {
    /// The number of the next mutant, where it is one of those to write.
    fn id(&mut self, line: usize, told: &str) -> Option<u32> {
        let id = *self.next;
        *self.next += 1;
        self.list.push(format!("{id}\t{}:{line}\t{told}", self.file));
        self.chosen.contains(&id).then_some(id)
    }

    /// `expr`, or `other` where the mutant is chosen.
    fn either(&mut self, expr: &Expr, other: &Expr, line: usize, told: &str) -> Expr {
        let Some(id) = self.id(line, told) else { return expr.clone() };
        let tokens = quote!((if crate::mutant::on(#id) { (#other) } else { (#expr) }));
        syn::parse2(tokens.clone()).unwrap_or_else(|error| panic!("{}:{line}: {error}: {tokens}", self.file))
    }
}

fn has_let(expr: &Expr) -> bool {
    match expr {
        Expr::Let(_) => true,
        Expr::Binary(binary) => has_let(&binary.left) || has_let(&binary.right),
        Expr::Paren(paren) => has_let(&paren.expr),
        _ => false,
    }
}

fn swapped(op: &BinOp) -> Vec<BinOp> {
    match op {
        BinOp::Add(_) => vec![parse_quote!(-)],
        BinOp::Sub(_) => vec![parse_quote!(+)],
        BinOp::Mul(_) => vec![parse_quote!(/)],
        BinOp::Div(_) => vec![parse_quote!(*)],
        BinOp::Rem(_) => vec![parse_quote!(*)],
        BinOp::And(_) => vec![parse_quote!(||)],
        BinOp::Or(_) => vec![parse_quote!(&&)],
        BinOp::BitAnd(_) => vec![parse_quote!(|)],
        BinOp::BitOr(_) => vec![parse_quote!(&)],
        BinOp::Shl(_) => vec![parse_quote!(>>)],
        BinOp::Shr(_) => vec![parse_quote!(<<)],
        BinOp::Eq(_) => vec![parse_quote!(!=)],
        BinOp::Ne(_) => vec![parse_quote!(==)],
        BinOp::Lt(_) => vec![parse_quote!(<=), parse_quote!(>)],
        BinOp::Le(_) => vec![parse_quote!(<)],
        BinOp::Gt(_) => vec![parse_quote!(>=), parse_quote!(<)],
        BinOp::Ge(_) => vec![parse_quote!(>)],
        BinOp::AddAssign(_) => vec![parse_quote!(-=)],
        BinOp::SubAssign(_) => vec![parse_quote!(+=)],
        BinOp::MulAssign(_) => vec![parse_quote!(/=)],
        _ => vec![],
    }
}

const SWAPPED: [(&str, &str); 6] = [
    ("min", "max"),
    ("max", "min"),
    ("floor", "ceil"),
    ("any", "all"),
    ("all", "any"),
    ("round_ties_even", "trunc"),
];

impl VisitMut for Mutator<'_> {
    fn visit_item_mut(&mut self, item: &mut Item) {
        // Constants, types and macros are fixed when the crate is compiled.
        match item {
            Item::Fn(function) if function.sig.constness.is_none() && !is_test(&function.attrs) => {
                self.visit_block_mut(&mut function.block);
            }
            Item::Impl(block) if !is_test(&block.attrs) => {
                for item in &mut block.items {
                    if let syn::ImplItem::Fn(function) = item
                        && function.sig.constness.is_none()
                    {
                        self.visit_block_mut(&mut function.block);
                    }
                }
            }
            _ => {}
        }
    }

    fn visit_pat_mut(&mut self, _: &mut syn::Pat) {}
    fn visit_type_mut(&mut self, _: &mut syn::Type) {}
    fn visit_generic_argument_mut(&mut self, _: &mut syn::GenericArgument) {}
    fn visit_expr_const_mut(&mut self, _: &mut syn::ExprConst) {}
    fn visit_expr_repeat_mut(&mut self, repeat: &mut syn::ExprRepeat) {
        self.visit_expr_mut(&mut repeat.expr);
    }

    // (The block after a let's else must not come to its end, so it stays as it is.)
    fn visit_local_init_mut(&mut self, init: &mut syn::LocalInit) {
        self.visit_expr_mut(&mut init.expr);
    }

    fn visit_stmt_mut(&mut self, stmt: &mut Stmt) {
        let line = stmt.span().start().line;
        let lost = match &*stmt {
            Stmt::Expr(
                Expr::Call(_) | Expr::MethodCall(_) | Expr::Continue(_) | Expr::Assign(_),
                Some(_),
            ) => true,
            Stmt::Expr(Expr::Try(tried), Some(_)) => {
                matches!(&*tried.expr, Expr::MethodCall(_) | Expr::Call(_))
            }
            _ => false,
        };
        let told: String = stmt.to_token_stream().to_string().chars().take(40).collect();
        visit_mut::visit_stmt_mut(self, stmt);
        if lost && let Some(id) = self.id(line, &format!("lost: {told}")) {
            let kept = stmt.clone();
            *stmt = parse_quote!(if !crate::mutant::on(#id) { #kept });
        }
    }

    fn visit_expr_if_mut(&mut self, expr: &mut syn::ExprIf) {
        let line = expr.cond.span().start().line;
        let plain = !has_let(&expr.cond);
        visit_mut::visit_expr_if_mut(self, expr);
        if plain && let Some(id) = self.id(line, "condition inverted") {
            let cond = &expr.cond;
            expr.cond = parse_quote!((crate::mutant::on(#id) != (#cond)));
        }
    }

    fn visit_expr_mut(&mut self, expr: &mut Expr) {
        let line = expr.span().start().line;
        let plain = !has_let(expr);
        // A reference to a constant may live for ever; one to what is computed may not.
        if let Expr::Reference(reference) = expr
            && matches!(&*reference.expr, Expr::Array(_) | Expr::Lit(_))
        {
            return;
        }
        let before: String = expr.to_token_stream().to_string().chars().take(50).collect();
        visit_mut::visit_expr_mut(self, expr);
        if !plain {
            return;
        }
        let original = expr.clone();
        match original.clone() {
            Expr::Binary(binary) => {
                for op in swapped(&binary.op) {
                    let mut other = binary.clone();
                    let told =
                        format!("{} for {}: {before}", op.to_token_stream(), binary.op.to_token_stream());
                    other.op = op;
                    *expr = self.either(&expr.clone(), &Expr::Binary(other), line, &told);
                }
            }
            Expr::Unary(unary) if matches!(unary.op, UnOp::Not(_) | UnOp::Neg(_)) => {
                *expr = self.either(&original, &unary.expr, line, &format!("sign lost: {before}"));
            }
            Expr::Lit(ExprLit { lit: Lit::Int(int), .. }) => {
                let Ok(value) = int.base10_parse::<u64>() else { return };
                let more = syn::LitInt::new(&format!("{}{}", value + 1, int.suffix()), int.span());
                *expr =
                    self.either(&original, &parse_quote!(#more), line, &format!("{} for {value}", value + 1));
            }
            Expr::Lit(ExprLit { lit: Lit::Float(float), .. }) => {
                let Ok(value) = float.base10_parse::<f64>() else { return };
                let other = if value == 0.0 { 1.0 } else { value * 2.0 };
                let other = syn::LitFloat::new(&format!("{other:?}{}", float.suffix()), float.span());
                *expr =
                    self.either(&original, &parse_quote!(#other), line, &format!("{other} for {value:?}"));
            }
            Expr::Lit(ExprLit { lit: Lit::Bool(flag), .. }) => {
                let other = !flag.value;
                *expr = self.either(
                    &original,
                    &parse_quote!(#other),
                    line,
                    &format!("{other} for {}", flag.value),
                );
            }
            Expr::MethodCall(call) => {
                let found = SWAPPED.iter().find(|(name, _)| call.method == name);
                if let Some((name, other)) = found {
                    let mut changed = call.clone();
                    changed.method = syn::Ident::new(other, call.method.span());
                    let told = format!("{other} for {name}: {before}");
                    *expr = self.either(&original, &Expr::MethodCall(changed), line, &told);
                }
            }
            _ => {}
        }
    }
}

fn is_test(attrs: &[syn::Attribute]) -> bool {
    attrs.iter().any(|attr| attr.to_token_stream().to_string().contains("test"))
}

const SWITCH: &str = r#"
/// Which mutant runs.
#[doc(hidden)]
#[allow(missing_docs)]
pub mod mutant {
    use std::sync::atomic::{AtomicU32, Ordering};
    static CHOSEN: AtomicU32 = AtomicU32::new(u32::MAX);
    #[inline(always)]
    pub fn on(id: u32) -> bool {
        let chosen = CHOSEN.load(Ordering::Relaxed);
        if chosen == u32::MAX { read() == id } else { chosen == id }
    }
    #[cold]
    fn read() -> u32 {
        let chosen = std::env::var("MUTANT").ok().and_then(|text| text.parse().ok()).unwrap_or(0);
        CHOSEN.store(chosen, Ordering::Relaxed);
        chosen
    }
}
"#;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let (source, out, files) = match arguments.as_slice() {
        ["list", source, files @ ..] => (Path::new(source), None, files),
        ["write", source, out, files @ ..] => (Path::new(source), Some(Path::new(out)), files),
        _ => return Err("want list CRATE FILE..., or write CRATE OUT FILE...".into()),
    };
    let mut chosen = HashSet::new();
    if out.is_some() {
        for number in std::io::read_to_string(std::io::stdin())?.split_whitespace() {
            chosen.insert(number.parse()?);
        }
    }
    let (mut next, mut list) = (1, Vec::new());
    for file in files {
        let mut parsed = syn::parse_file(&std::fs::read_to_string(source.join("src").join(file))?)?;
        Mutator { file, next: &mut next, list: &mut list, chosen: &chosen }.visit_file_mut(&mut parsed);
        if let Some(out) = out {
            std::fs::write(out.join("src").join(file), prettyplease::unparse(&parsed))?;
        }
    }
    if let Some(out) = out {
        let library = std::fs::read_to_string(source.join("src/lib.rs"))?;
        std::fs::write(out.join("src/lib.rs"), library + SWITCH)?;
    } else {
        for line in list {
            println!("{line}");
        }
    }
    Ok(())
}

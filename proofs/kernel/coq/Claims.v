(** What certificates claim, apart from [robust] in Spec.v. With that file and Pddl.v this is all that has to be read. *)

Require Import Reals QArith Qreals List Bool.
Require Import Spec.
Import ListNotations.
Open Scope R_scope.

(** A region of parameter values: linear facts that hold in it. *)
Definition inside (g : nat -> R) (region : list (expr * bool)) : Prop :=
  forall e strict, In (e, strict) region -> above strict (ev g (fun _ => 0) e).

(** Values with a schedule, of which all schedules are valid: the robustness envelope. [robust P epsilon region] is that
    all values inside of the region are in it. *)
Definition in_envelope (P : plan) (epsilon : Q) (g : nat -> R) : Prop :=
  (exists t, kept P g t) /\ forall t, kept P g t -> valid P epsilon g t.

(** ** Regions of good values *)

(** The region is not empty, within the declared bounds, and robust. *)
Definition good (P : plan) (epsilon : Q) (declared region : list (expr * bool)) : Prop :=
  (exists g, inside g region) /\ (forall g, inside g region -> inside g declared) /\ robust P epsilon region.

(** ** Boxes *)

(** The ends of a range, if any, and whether they belong to it. *)
Record range := { lower : option (Q * bool); upper : option (Q * bool) }.

Definition in_range (r : range) (x : R) : Prop :=
  match lower r with Some (q, closed) => if closed then Q2R q <= x else Q2R q < x | None => True end /\
  match upper r with Some (q, closed) => if closed then x <= Q2R q else x < Q2R q | None => True end.

(** Ranges of the parameters 0, 1, ... *)
Definition in_box (g : nat -> R) (b : list range) : Prop := forall i r, nth_error b i = Some r -> in_range r (g i).

(** All values in the box are in the envelope and within the declared bounds, and there are some. *)
Definition good_box (P : plan) (epsilon : Q) (declared b : list range) : Prop :=
  (exists g, in_box g b) /\ forall g, in_box g b -> in_box g declared /\ in_envelope P epsilon g.

(** And no other such box contains it. *)
Definition maximal (P : plan) (epsilon : Q) (declared b : list range) : Prop :=
  good_box P epsilon declared b /\
  forall wider, length wider = length b -> (forall g, in_box g b -> in_box g wider) -> good_box P epsilon declared wider ->
    forall g, in_box g wider -> in_box g b.

(** ** The whole envelope *)

(** Within the declared bounds (where the network has a schedule, if only these values are meant) exactly the values in
    no removed polyhedron are in the envelope. *)
Definition envelope (P : plan) (epsilon : Q) (declared : list (expr * bool)) (removed : list (list (expr * bool)))
    (if_scheduled : bool) : Prop :=
  forall g, inside g declared -> (if_scheduled = true -> exists t, kept P g t) ->
    (in_envelope P epsilon g <-> forall piece, In piece removed -> ~ inside g piece).
